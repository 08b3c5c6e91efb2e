// Built when a struct of the boundary had another size.
#include "tiny_plugin.h"

TINY_DESCRIPTOR(v1, d.layout_tag = dreamsearch::LayoutTag() ^ 1)
