// abi_subject.cc - names every type that crosses the plugin boundary, for abi.sh.
#include "dreamsearch/plugin.h"

namespace dreamsearch {

// What a plugin exports reaches the descriptors and, by the factories, the interfaces and all that
// their calls take; extensions are reached by name alone and so named here.
struct Boundary {
  const PluginDescriptor* plugin;
  StateSaving* state_saving;
  Rendering* rendering;
  ValueSpread* value_spread;
  ReturnGradient* return_gradient;
  TensorExport* tensor_export;
  TreeReporting* tree_reporting;
  PolicyReporting* policy_reporting;
};

__attribute__((visibility("default"))) void Cross(Boundary* boundary) {
  static_cast<void>(boundary);
}

}  // namespace dreamsearch
