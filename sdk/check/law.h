// law.h - what a law is made of, for the files that state laws.
//
// A law's function returns if the law is kept and otherwise leaves with Break. Before each call of
// the component it notes which call that is, so that a crash or a hang can be located.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "dreamsearch/check/check.h"
#include "dreamsearch/plugin.h"

namespace dreamsearch::check {

struct Broken {
  std::string expected, found;
};
struct Skipped {
  std::string why;
};
[[noreturn]] inline void Break(const std::string& expected, const std::string& found) {
  throw Broken{expected, found};
}
inline void Expect(bool holds, const std::string& expected, const std::string& found) {
  if (!holds) Break(expected, found);
}
[[noreturn]] inline void Skip(const std::string& why) { throw Skipped{why}; }

// A printf format as a string.
__attribute__((format(printf, 1, 2))) std::string Format(const char* format, ...);
std::string Text(const Status& status);  // "invalid argument: the root is ..."
std::string Number(double number);       // with all its digits

// What is called now: "Plan, decision 3". Read by the parent when the child is gone.
void NoteCall(std::string_view call);
// A remark about a law that is kept.
void Remark(const std::string& text);

// Calls of malloc and its like so far, if this process counts them (allocation_counter.cc).
bool CountsAllocations();
std::uint64_t Allocations();

struct Sizes {
  std::uint64_t observation = 3;  // O
  std::uint64_t action = 2;       // A
  std::uint64_t latent_bytes = 128;
};

struct Case {
  std::string label;
  std::vector<Setting> settings = {};  // on top of the subject's
  Sizes sizes = {};
  // A refusal with a sentence, and an end at a limit of time or memory, keep the law.
  bool may_refuse = false;
  bool strict = false;
};

// One case under way.
class Trial {
 public:
  Trial(const Subject& subject, const Case& tried);

  const ComponentDescriptor& component() const { return *subject_.component; }
  const Subject& subject() const { return subject_; }
  const Case& tried() const { return case_; }
  const Sizes& sizes() const { return case_.sizes; }
  // Whether a use looks at the answers too: at the ends of parameters and at other sizes, where no
  // other law does.
  bool strict() const { return case_.strict; }
  bool Has(Trait trait) const { return (component().traits & trait) != 0; }
  // Its resolved values.
  Parameters parameters() const { return {{values_.data(), values_.size()}}; }

 private:
  const Subject& subject_;
  const Case case_;
  std::vector<Setting> settings_;  // own the texts
  std::vector<ParameterValue> values_;
};

struct Law {
  const char* number;
  std::uint32_t kinds;  // bits 1 << ComponentKind
  Level level;
  const char* title;
  const char* advice;
  void (*hold)(const Trial& trial);
  std::vector<Case> (*cases)(const Subject& subject) = nullptr;  // null: one
};

constexpr std::uint32_t KindBit(ComponentKind kind) {
  return 1u << static_cast<std::uint32_t>(kind);
}
inline constexpr std::uint32_t kOfEnvironments = KindBit(ComponentKind::kEnvironment);
inline constexpr std::uint32_t kOfModels = KindBit(ComponentKind::kModel);
inline constexpr std::uint32_t kOfPlanners = KindBit(ComponentKind::kPlanner);
inline constexpr std::uint32_t kOfAll = kOfEnvironments | kOfModels | kOfPlanners;

View<const Law> ComponentLaws();
View<const Law> PlannerLaws();
View<const Law> ModelLaws();
View<const Law> EnvironmentLaws();

// Uses a component in every way once: what C laws do with it. `calls` is about how much.
void UsePlanner(const Trial& trial, int calls);
void UseModel(const Trial& trial, int calls);
void UseEnvironment(const Trial& trial, int calls);
void Use(const Trial& trial, int calls);

}  // namespace dreamsearch::check
