// early.cc - tasks whose episodes end early: by a time limit of their own, by a death, with no
// declared limit to speak of.
#include <algorithm>

#include "dreamsearch/plugin.h"

namespace dreamsearch {
namespace {

enum class Kind { kShort, kVaried, kSilent, kUnlimited, kRarelyBad, kAlwaysBad };

// A point that the action moves; the reward is 1 a step.
template <Kind kKind>
class Line final : public Environment {
 public:
  Line() {
    spec_.observation = {&part_, 1};
    spec_.observation_size = 2;
    spec_.action_size = 1;
    spec_.action_low = {&low_, 1};
    spec_.action_high = {&high_, 1};
    spec_.control_seconds = 0.02;
    spec_.episode_steps = kKind == Kind::kUnlimited ? 1000000000u : 400u;
    spec_.terminates = kKind == Kind::kVaried;
  }
  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t seed, View<double> observation) noexcept override {
    t_ = 0;
    seed_ = seed;
    x_ = (seed % 1000) / 1000.0 - 0.5;
    end_ = kKind == Kind::kShort ? 20 : kKind == Kind::kUnlimited ? 100 : 120 + seed % 97;
    Show(observation);
    return OkStatus();
  }
  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override {
    x_ += 0.01 * action[0];
    ++t_;
    const bool bad = kKind == Kind::kAlwaysBad || (kKind == Kind::kRarelyBad && seed_ % 3 == 0);
    if (bad && t_ == 50) return Error(StatusCode::kDiverged, "bad acceleration at step %u", t_);
    Show(observation);
    const bool last = t_ >= end_;
    const bool dies = kKind == Kind::kVaried || kKind == Kind::kSilent;
    result->reward = 1;
    result->discount = last && dies ? 0 : 1;
    result->last = last;
    return OkStatus();
  }
  void Destroy() noexcept override { delete this; }

 private:
  ~Line() = default;
  void Show(View<double> observation) const noexcept {
    observation[0] = x_;
    observation[1] = t_ / 100.0;
  }

  ObservationPart part_{"state", 2};
  double low_ = -1, high_ = 1;
  EnvironmentSpec spec_;
  std::uint32_t seed_ = 0, t_ = 0, end_ = 0;
  double x_ = 0;
};

template <Kind kKind>
Status Make(const EnvironmentContext&, Environment** result) noexcept {
  *result = new Line<kKind>;
  return OkStatus();
}

constexpr ComponentDescriptor Task(const char* name, EnvironmentFactory factory) {
  return {.kind = ComponentKind::kEnvironment,
          .name = name,
          .version = "1",
          .summary = "A point on a line.",
          .create_environment = factory};
}

constexpr ComponentDescriptor kComponents[] = {
    Task("short20", Make<Kind::kShort>),        Task("varied", Make<Kind::kVaried>),
    Task("silent", Make<Kind::kSilent>),        Task("unlimited", Make<Kind::kUnlimited>),
    Task("rarely_bad", Make<Kind::kRarelyBad>), Task("always_bad", Make<Kind::kAlwaysBad>)};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("early", "1.0.0", dreamsearch::kComponents)
