// Built against SDK 0.5.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(dreamsearch_plugin_v0, d.sdk_major = 0; d.sdk_minor = 5)
