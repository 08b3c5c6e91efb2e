// Built against an earlier minor version of the SDK.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(v0, d.sdk_minor = DREAMSEARCH_SDK_MINOR - 1)
