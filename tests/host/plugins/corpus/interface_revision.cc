// Built when the virtual functions had another order.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(v0, d.interface_revision = dreamsearch::kInterfaceRevision + 1)
