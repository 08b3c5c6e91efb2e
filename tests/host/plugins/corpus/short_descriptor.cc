// Its descriptor is shorter than this SDK's.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(v0, d.struct_size = 32)
