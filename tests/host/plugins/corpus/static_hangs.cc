// Never ends loading.
#include "tests/host/plugins/corpus/tiny_plugin.h"

namespace {
volatile bool go_on = true;
}
WHILE_LOADING(while (go_on){})
TINY_PLUGIN(static_hangs)
