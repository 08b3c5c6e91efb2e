// Built before SDK 0.1, when what it was built against called itself 1.0.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(dreamsearch_plugin_v1, )
