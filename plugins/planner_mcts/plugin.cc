// plugin.cc - what planner_mcts.so offers.
#include "mcts.h"

namespace dreamsearch {
namespace {

const ComponentDescriptor kComponents[] = {kMctsPw, kMctsFixed, kMctsGumbel, kHoot};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("planner_mcts", "1.0.0", dreamsearch::kComponents)
