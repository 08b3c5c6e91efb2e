// broken.h - components that are right but for one thing, each with the law that it breaks.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "dreamsearch/check/check.h"

namespace dreamsearch::check {

struct BrokenComponent {
  const ComponentDescriptor* component = nullptr;
  std::string law;             // empty: nothing is wrong with it
  std::string found;           // what the check must say
  Level level = Level::kLaws;  // at which all other laws are kept
  Verdict verdict = Verdict::kBroken;
  std::vector<Setting> settings = {};
};

// For messages of GoogleTest.
inline void PrintTo(const BrokenComponent& broken, std::ostream* out) {
  *out << broken.component->name << " that breaks "
       << (broken.law.empty() ? "nothing" : broken.law);
}

std::vector<BrokenComponent> BrokenPlanners();
std::vector<BrokenComponent> BrokenModels();
std::vector<BrokenComponent> BrokenEnvironments();
// Planners that crash, exit, hang or fill memory in Plan; `found` says where.
std::vector<BrokenComponent> DyingPlanners();

}  // namespace dreamsearch::check
