// Its descriptor is shorter than this SDK's.
#include "tiny_plugin.h"

TINY_DESCRIPTOR(v1, d.struct_size = 32)
