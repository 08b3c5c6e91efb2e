// Built against the next major version of the SDK.
#include "tiny_plugin.h"

TINY_DESCRIPTOR(v2, d.sdk_major = 2)
