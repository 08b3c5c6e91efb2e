// Its descriptor begins with something else.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(dreamsearch_sdk_1, d.magic = 0x1234)
