// Offers two planners of one name.
#include "tests/host/plugins/corpus/tiny_plugin.h"

namespace {
constexpr dreamsearch::ComponentDescriptor kComponents[] = {dreamsearch::TinyPlanner("twice"),
                                                            dreamsearch::TinyPlanner("twice")};
}
DREAMSEARCH_PLUGIN("duplicate_component", "1.0.0", kComponents)
