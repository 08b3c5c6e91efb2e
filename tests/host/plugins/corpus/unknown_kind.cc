// Offers a component of a kind that this SDK does not know.
#include "tests/host/plugins/corpus/tiny_plugin.h"

namespace {
constexpr dreamsearch::ComponentDescriptor Strange() {
  dreamsearch::ComponentDescriptor component = dreamsearch::TinyPlanner("strange");
  component.kind = static_cast<dreamsearch::ComponentKind>(9);
  return component;
}
constexpr dreamsearch::ComponentDescriptor kComponents[] = {Strange()};
}  // namespace
DREAMSEARCH_PLUGIN("unknown_kind", "1.0.0", kComponents)
