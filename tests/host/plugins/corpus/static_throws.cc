// Throws while it is loaded.
#include <stdexcept>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING(throw std::runtime_error("no licence found"))
TINY_PLUGIN(static_throws)
