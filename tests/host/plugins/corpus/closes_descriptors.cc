// Closes every descriptor, the describing pipe among them.
#include <unistd.h>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING(for (int i = 0; i < 256; ++i)::close(i))
TINY_PLUGIN(closes_descriptors)
