// Stops its process while it is loaded.
#include <signal.h>

#include "tiny_plugin.h"

WHILE_LOADING(::raise(SIGSTOP))
TINY_PLUGIN(stops_itself)
