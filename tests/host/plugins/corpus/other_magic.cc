// Its descriptor begins with something else.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(v0, d.magic = 0x1234)
