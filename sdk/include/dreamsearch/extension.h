// extension.h - optional capabilities of a component, asked for by name.
//
// An extension is a small interface with a name and a version, "render/1". A component offers
// one by deriving from it through Offers, in one line:
//
//     class Pendulum final : public Offers<Environment, StateSaving, Rendering> {
//
// and the compiler then asks for its functions. Who wants one asks the object; null says that
// it is not offered:
//
//     if (auto* drawn = ExtensionOf<Rendering>(environment)) status = drawn->Render(...);
//
// Those of the SDK stand beside the interface they extend:
//
//     environment.h   StateSaving   Rendering
//     model.h         ValueSpread   ReturnGradient   TensorExport
//     planner.h       TreeReporting   PolicyReporting
//
// A name without a dot belongs to the SDK. Name your own "organisation.name/1". A planner asks
// a model through the host, which passes on the extensions of the SDK alone.
//
// Memory   an extension is part of its object and lives as long.
// Threads, errors   as of the object's own calls. What an object offers never changes.
#pragma once

#include <cstring>

#include "dreamsearch/version.h"

namespace dreamsearch {

// `Base`, an interface or a class that implements part of one, with the extensions.
template <typename Base, typename... Extensions>
class Offers : public Base, public Extensions... {
 public:
  void* Extension(const char* name) noexcept override {
    void* found = nullptr;
    ((std::strcmp(name, Extensions::kName) == 0
          ? static_cast<void>(found = static_cast<Extensions*>(this))
          : static_cast<void>(0)),
     ...);
    return found != nullptr ? found : Base::Extension(name);
  }

 protected:
  using Base::Base;
  Offers() = default;
  ~Offers() = default;
};

// The extension of `component`, or null.
template <typename Wanted, typename Component>
Wanted* ExtensionOf(Component* component) noexcept {
  return static_cast<Wanted*>(component->Extension(Wanted::kName));
}

}  // namespace dreamsearch
