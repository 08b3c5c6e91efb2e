// Its descriptor is shorter than any version's.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(dreamsearch_sdk_1, d.struct_size = 32)
