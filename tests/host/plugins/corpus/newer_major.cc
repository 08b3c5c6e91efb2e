// Built against the next major version of the SDK.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(dreamsearch_sdk_2, d.sdk_major = 2)
