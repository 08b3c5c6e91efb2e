// Writes to the null address while it is loaded.
#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING({
  volatile int* volatile nowhere = nullptr;
  *nowhere = 1;
})
TINY_PLUGIN(segfaults)
