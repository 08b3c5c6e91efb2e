// Stops its process while it is loaded.
#include <signal.h>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING(::raise(SIGSTOP))
TINY_PLUGIN(stops_itself)
