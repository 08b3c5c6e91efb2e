// Aborts while it is loaded.
#include <cstdlib>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING(std::abort())
TINY_PLUGIN(static_aborts)
