// Says that a component's declaration is shorter than any version has it.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(dreamsearch_sdk_1, d.components.stride = 64)
