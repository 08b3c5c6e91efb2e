// owned.h - components that are destroyed with their owner.
#pragma once

#include <memory>

namespace dreamsearch {

struct Destroyer {
  template <typename T>
  void operator()(T* component) const {
    component->Destroy();
  }
};
template <typename T>
using Owned = std::unique_ptr<T, Destroyer>;

}  // namespace dreamsearch
