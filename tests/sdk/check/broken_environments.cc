// broken_environments.cc - a ball that is pushed along a line, and what can be wrong with a task.
#include <cmath>
#include <cstring>

#include "dreamsearch/plugin.h"
#include "dreamsearch/random.h"
#include "tests/sdk/check/broken.h"

namespace dreamsearch::check {
namespace {

enum class Fault {
  kNone,
  kPartsDoNotAddUp,
  kStepsOn,
  kTakesNan,
  kLeavesTheReward,
  kWritesPastTheObservation,
  kDiscountOfAHalf,
  kReturnOutOfRange,
  kEndless,
  kIgnoresItsSeed,
  kSharesState,
  kForgetsVelocity,
  kOverflows,
  kHasNoBounds,
};

struct State {
  double x = 0, v = 0;
  std::uint64_t step = 0, under_way = 0;
};
State shared_state;  // of Fault::kSharesState

template <Fault kFault>
class Ball final : public Offers<Environment, StateSaving> {
 public:
  Ball() {
    spec_.observation = Records<ObservationPart>(parts_, 2);
    spec_.observation_size = 3;
    spec_.action_size = 1;
    if (kFault != Fault::kHasNoBounds) spec_.action_low = {&low_, 1};
    spec_.action_high = {&high_, 1};
    spec_.control_seconds = 0.1;
    spec_.episode_steps = 50;
    spec_.return_low = 0;
    spec_.return_high = kFault == Fault::kReturnOutOfRange ? 0.5 : 50;
    if (kFault == Fault::kPartsDoNotAddUp) parts_[1].size = 2;
  }

  const EnvironmentSpec& spec() const noexcept override { return spec_; }

  Status Reset(std::uint32_t seed, View<double> observation) noexcept override {
    if (observation.size != 3) return Error(StatusCode::kInvalidArgument, "3 numbers expected");
    if (kFault != Fault::kIgnoresItsSeed) random_ = Random(seed);
    state() = {random_.Uniform(-1, 1), random_.Uniform(-1, 1), 0, 1};
    Observe(observation);
    return OkStatus();
  }

  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override {
    if (state().under_way == 0) {
      return Error(StatusCode::kFailedPrecondition, "no episode is under way");
    }
    if (action.size != 1 || observation.size != 3) {
      return Error(StatusCode::kInvalidArgument, "1 action and 3 numbers expected");
    }
    if (!std::isfinite(action[0]) && kFault != Fault::kTakesNan) {
      return Error(StatusCode::kInvalidArgument, "the action is %g", action[0]);
    }
    double push = std::isnan(action[0]) ? 0 : std::fmin(std::fmax(action[0], low_), high_);
    if (kFault == Fault::kOverflows && std::abs(action[0]) > 1e200) push = action[0] * 1e100;
    state().v = 0.9 * state().v + 0.1 * push;
    state().x = std::tanh(state().x + state().v) + (kFault == Fault::kOverflows ? 0 * push : 0);
    ++state().step;
    const bool last = kFault == Fault::kEndless ? state().step == 60 : state().step == 50;
    if (last && kFault != Fault::kStepsOn) state().under_way = 0;
    Observe(observation);
    if (kFault != Fault::kLeavesTheReward) result->reward = std::exp(-state().x * state().x);
    result->discount = kFault == Fault::kDiscountOfAHalf ? 0.5 : 1;
    result->last = last;
    return OkStatus();
  }

  std::uint64_t state_bytes() const noexcept override { return sizeof(State); }
  Status SaveState(View<std::byte> saved) const noexcept override {
    if (saved.size != sizeof(State)) return Error(StatusCode::kInvalidArgument, "other size");
    State copy = state();
    if (kFault == Fault::kForgetsVelocity) copy.v = 0;
    std::memcpy(saved.data, &copy, sizeof copy);
    return OkStatus();
  }
  Status RestoreState(View<const std::byte> saved) noexcept override {
    if (saved.size != sizeof(State)) return Error(StatusCode::kDataLoss, "other size");
    std::memcpy(&state(), saved.data, sizeof(State));
    return OkStatus();
  }
  void Destroy() noexcept override { delete this; }

 private:
  ~Ball() = default;

  State& state() { return kFault == Fault::kSharesState ? shared_state : state_; }
  const State& state() const { return kFault == Fault::kSharesState ? shared_state : state_; }
  void Observe(View<double> observation) const {
    observation[0] = state().x;
    observation[1] = state().v;
    observation[2] = state().x * state().v;
    if (kFault == Fault::kWritesPastTheObservation) observation.data[3] = 0;
  }

  ObservationPart parts_[2] = {{"position", 2}, {"product", 1}};
  double low_ = -1, high_ = 1;
  EnvironmentSpec spec_;
  State state_;
  Random random_{1};
};

template <Fault kFault>
Status Create(const EnvironmentContext&, Environment** result) noexcept {
  if (kFault == Fault::kSharesState) shared_state = {};
  *result = new Ball<kFault>;
  return OkStatus();
}

template <Fault kFault>
const ComponentDescriptor* Component() {
  static const ComponentDescriptor component = [] {
    ComponentDescriptor made;
    made.kind = ComponentKind::kEnvironment;
    made.name = "broken_environment";
    made.version = "1.0.0";
    made.summary = "right but for one thing";
    made.create_environment = Create<kFault>;
    return made;
  }();
  return &component;
}

}  // namespace

std::vector<BrokenComponent> BrokenEnvironments() {
  constexpr auto kExtremes = Level::kExtremes;
  return {
      {Component<Fault::kNone>(), "", "", kExtremes},
      {Component<Fault::kHasNoBounds>(), "C3", "0"},
      {Component<Fault::kPartsDoNotAddUp>(), "E1", "4 (position 2 + product 2)", kExtremes},
      {Component<Fault::kStepsOn>(), "E2", "success", kExtremes},
      {Component<Fault::kTakesNan>(), "E3", "success", kExtremes},
      {Component<Fault::kLeavesTheReward>(), "E4", "was not set"},
      {Component<Fault::kWritesPastTheObservation>(), "E4", "a write 24 bytes from its beginning"},
      {Component<Fault::kDiscountOfAHalf>(), "E5", "0.5", kExtremes},
      {Component<Fault::kReturnOutOfRange>(), "E5", "with random actions", kExtremes},
      {Component<Fault::kEndless>(), "E5", "an episode that goes on", kExtremes},
      {Component<Fault::kIgnoresItsSeed>(), "E6", "", kExtremes},
      {Component<Fault::kSharesState>(), "E7", "", kExtremes},
      {Component<Fault::kForgetsVelocity>(), "E8", "", kExtremes},
      {Component<Fault::kOverflows>(), "E9", "NaN, or was not set", kExtremes},
  };
}

}  // namespace dreamsearch::check
