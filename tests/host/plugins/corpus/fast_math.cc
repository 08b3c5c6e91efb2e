// Linked with -ffast-math: loading it sets flush-to-zero.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_PLUGIN(fast_math)
