// Sets the rounding mode while it is loaded.
#include <cfenv>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING(std::fesetround(FE_UPWARD))
TINY_PLUGIN(changes_rounding)
