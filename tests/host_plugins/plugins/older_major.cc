// Built against the previous major version of the SDK.
#include "tiny_plugin.h"

TINY_DESCRIPTOR(v0, d.sdk_major = 0)
