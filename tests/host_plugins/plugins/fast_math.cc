// Linked with -ffast-math: loading it sets flush-to-zero.
#include "tiny_plugin.h"

TINY_PLUGIN(fast_math)
