// Built when a struct of the boundary had another size.
#include "tests/host/plugins/corpus/tiny_plugin.h"

TINY_DESCRIPTOR(v0, d.layout_tag = dreamsearch::LayoutTag() ^ 1)
