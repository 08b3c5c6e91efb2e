// version.h - the one place where versions are written.
//
// CMake reads these lines, so keep them as plain #defines.
//
// The project version names a release. The SDK version names the plugin boundary.
// Until it is frozen as 1.0 it is 0.x, and a host loads a plugin if and only if the
// plugin was built against the very same version, major and minor; it says expected
// and found where it refuses one. Any change of the boundary raises the minor version.
#pragma once

#define DREAMSEARCH_VERSION "0.1.0"
#define DREAMSEARCH_SDK_MAJOR 0
#define DREAMSEARCH_SDK_MINOR 5
