// Needs a library that the loader does not find.
#include "tests/host/plugins/corpus/tiny_plugin.h"

int FromAnotherLibrary();

WHILE_LOADING(FromAnotherLibrary())
TINY_PLUGIN(missing_dependency)
