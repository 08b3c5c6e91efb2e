// plugin.cc - what planner_shooting.so offers.
#include "shooting_planner.h"

namespace dreamsearch {
namespace {

const ComponentDescriptor kComponents[] = {kRandomShooting, kCem, kIcem, kMppi};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("planner_shooting", "1.0.0", dreamsearch::kComponents)
