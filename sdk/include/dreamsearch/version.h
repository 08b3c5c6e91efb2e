// version.h - the versions, and the one rule of what loads where.
//
// CMake reads these lines, so keep them as plain #defines.
//
// The project version names a release. The SDK version names the plugin boundary. Within a
// major version the boundary only grows: a plugin built against 1.x loads in a host of 1.y,
// whichever is newer, and both use what both know.
//
//   Entry       A library exports one symbol, named after the major version (plugin.h). A host
//               looks for its own and loads no other.
//   Structs     that cross carry their size in `struct_size`, which stands behind the fields of
//               1.0; later fields stand behind it. A struct is taken through Received (sized.h),
//               which gives a field that the sender does not know its default. View, MatrixView,
//               Records, Status, Parameters and PresetValue are frozen as they are.
//   Arrays      of structs cross as Records, which carry the size of an element, its stride.
//               Their elements grow at the end, in whole multiples of 8 bytes.
//   Interfaces  No virtual function is ever added, removed or moved. What is optional is an
//               extension that is asked for by name (extension.h). One that must change becomes
//               another extension, "render/2" beside "render/1".
//   Traits,     new bits and new kinds may come. A host passes over those of a plugin newer than
//   kinds       itself, so nothing may depend on their being understood.
//
// Anything else needs a new major version. layout.h holds where the fields of 1.0 lie, a plugin
// that was compiled otherwise does not compile; the tests hold the rest (tests/sdk).
#pragma once

#define DREAMSEARCH_VERSION "0.1.0"
#define DREAMSEARCH_SDK_MAJOR 1
#define DREAMSEARCH_SDK_MINOR 0

#if __cplusplus <= 201703L
#error "dreamsearch needs C++20: compile with -std=c++20"
#endif
