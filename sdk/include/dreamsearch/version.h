// version.h - the one place where versions are written.
//
// CMake reads these lines, so keep them as plain #defines.
//
// The project version names a release. The SDK version names the plugin
// boundary: a host loads a plugin when the major versions are equal and the
// plugin's minor version is not newer than the host's. Within a major version
// structs and virtual functions are only ever appended.
#pragma once

#define DREAMSEARCH_VERSION "0.1.0"
#define DREAMSEARCH_SDK_MAJOR 1
#define DREAMSEARCH_SDK_MINOR 0
