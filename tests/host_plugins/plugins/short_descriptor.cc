// Its descriptor is shorter than this SDK's.
#include "tiny_plugin.h"

TINY_DESCRIPTOR(v0, d.struct_size = 32)
