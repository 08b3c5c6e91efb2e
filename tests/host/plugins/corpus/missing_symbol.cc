// Calls a function that nobody defines.
#include "tests/host/plugins/corpus/tiny_plugin.h"

extern "C" int dreamsearch_test_defined_nowhere();

namespace {
dreamsearch::Status Make(const dreamsearch::PlannerContext&,
                         dreamsearch::Planner** result) noexcept {
  *result = nullptr;
  return dreamsearch::Error(dreamsearch::StatusCode::kInternal, "%d",
                            dreamsearch_test_defined_nowhere());
}
constexpr dreamsearch::ComponentDescriptor Planner() {
  dreamsearch::ComponentDescriptor component = dreamsearch::TinyPlanner("missing_symbol");
  component.create_planner = Make;
  return component;
}
constexpr dreamsearch::ComponentDescriptor kComponents[] = {Planner()};
}  // namespace
DREAMSEARCH_PLUGIN("missing_symbol", "1.0.0", kComponents)
