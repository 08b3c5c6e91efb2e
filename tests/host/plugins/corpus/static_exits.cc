// Ends the process, with success, while it is loaded.
#include <cstdlib>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING(std::_Exit(0))
TINY_PLUGIN(static_exits)
