// Its symbol and its descriptor disagree about the major version.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(dreamsearch_sdk_1, d.sdk_major = 7)
