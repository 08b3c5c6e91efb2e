// Built against the next major version of the SDK.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(v2, d.sdk_major = 2)
