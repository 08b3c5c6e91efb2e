// Needs a library that the loader does not find.
#include "tiny_plugin.h"

int FromAnotherLibrary();

WHILE_LOADING(FromAnotherLibrary())
TINY_PLUGIN(missing_dependency)
