// Nothing is wrong with it: every field a description can have.
#include "tests/host/plugins/corpus/tiny_plugin.h"

namespace {

using dreamsearch::ComponentDescriptor;
using dreamsearch::ComponentKind;

constexpr dreamsearch::ParameterSpec kParameters[] = {
    dreamsearch::RealParameter("noise", 0.3, 0, 10, "", "Exploration noise.").Preset("paper", 0.25),
    dreamsearch::IntParameter("simulations", 50, 1, 1000000, "simulations", "A decision's."),
    dreamsearch::BoolParameter("edge_reward", true, "Whether the reward of an edge counts."),
    dreamsearch::ChoiceParameter("first_play", "parent", "parent,zero", "An unvisited edge's Q."),
};
constexpr dreamsearch::MetricSpec kMetrics[] = {{"entropy", "nat", "Of the root's visits."}};

constexpr ComponentDescriptor Planner() {
  ComponentDescriptor component = dreamsearch::TinyPlanner("good");
  component.traits = dreamsearch::kSearches;
  component.aliases = "fine,well";
  component.parameters = dreamsearch::ViewOf(kParameters);
  component.metrics = dreamsearch::ViewOf(kMetrics);
  return component;
}

dreamsearch::Status MakeNoModel(const dreamsearch::ModelContext&,
                                dreamsearch::Model** result) noexcept {
  *result = nullptr;
  return dreamsearch::Error(dreamsearch::StatusCode::kUnimplemented, "for tests of the loader");
}

// A planner and a model may have the same name.
constexpr ComponentDescriptor kComponents[] = {
    Planner(),
    {.kind = ComponentKind::kModel,
     .traits = dreamsearch::kNeedsEnvironment | dreamsearch::kDefault,
     .name = "good",
     .version = "0.9.0",
     .summary = "A model for tests of the loader.",
     .create_model = MakeNoModel}};

}  // namespace
DREAMSEARCH_PLUGIN("good", "1.2.3", kComponents)
