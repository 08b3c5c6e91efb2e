// Aborts while it is loaded.
#include <cstdlib>

#include "tiny_plugin.h"

WHILE_LOADING(std::abort())
TINY_PLUGIN(static_aborts)
