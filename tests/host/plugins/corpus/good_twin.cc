// Offers the planner 'good', as good.so does.
#include "tests/host/plugins/corpus/tiny_plugin.h"

namespace {
constexpr dreamsearch::ComponentDescriptor kComponents[] = {dreamsearch::TinyPlanner("good")};
}
DREAMSEARCH_PLUGIN("good_twin", "2.0.0", kComponents)
