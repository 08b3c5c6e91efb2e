// pushed_ball.cc - a ball on a line is pushed to the origin, and stays there.
//
// Position x and velocity v, both observed. The action is a force f in [-1, 1] (units of the ball's
// weight); x' = v, v' = f - v / 2. The reward of a control step is exp(-4 x^2), so that an episode
// of 200 steps is worth 0 to 200.
#include <cmath>
#include <cstring>

#include "dreamsearch/factory.h"
#include "dreamsearch/random.h"
#include "dreamsearch/settings.h"

namespace dreamsearch {
namespace {

struct Settings {
  double start;
  std::uint32_t episode_steps;
};
constexpr auto kSettings = BindSettings<Settings>(
    Bind<&Settings::start>(
        RealParameter("start", 1, 0, 10, "m", "The first position lies between -start and start.")),
    Bind<&Settings::episode_steps>(
        IntParameter("episode_steps", 200, 1, 1000000, "steps", "Time limit of an episode.")));

class PushedBall final : public Offers<Environment, StateSaving> {
 public:
  explicit PushedBall(const EnvironmentContext& context)
      : settings_(kSettings.Read(context.parameters)) {
    spec_.observation = ViewOf(kParts);
    spec_.observation_size = 2;
    spec_.action_size = 1;
    spec_.action_low = ViewOf(kLow);
    spec_.action_high = ViewOf(kHigh);
    spec_.control_seconds = 0.05;
    spec_.substeps = kSubsteps;
    spec_.episode_steps = settings_.episode_steps;
    spec_.return_low = 0;
    spec_.return_high = settings_.episode_steps;
  }

  const EnvironmentSpec& spec() const noexcept override { return spec_; }

  Status Reset(std::uint32_t seed, View<double> observation) noexcept override {
    if (observation.size != 2) return WrongSize("observation", observation.size, 2);
    Random random(seed);
    state_ = {};
    state_.x = random.Uniform(-settings_.start, settings_.start);
    state_.under_way = true;
    Observe(observation);
    return OkStatus();
  }

  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override {
    if (!state_.under_way) {
      return Error(StatusCode::kFailedPrecondition, "Step: no episode is under way");
    }
    if (action.size != 1) return WrongSize("action", action.size, 1);
    if (observation.size != 2) return WrongSize("observation", observation.size, 2);
    if (!std::isfinite(action[0])) {
      return Error(StatusCode::kInvalidArgument, "Step: the action is %g", action[0]);
    }
    const double force = std::fmin(std::fmax(action[0], kLow[0]), kHigh[0]);
    const double dt = spec_.control_seconds / kSubsteps;
    for (std::uint32_t i = 0; i < kSubsteps; ++i) {
      state_.v += dt * (force - state_.v / 2);
      state_.x += dt * state_.v;
    }
    ++state_.step;
    const bool last = state_.step >= settings_.episode_steps;
    state_.under_way = !last;
    Observe(observation);
    result->reward = std::exp(-4 * state_.x * state_.x);
    result->discount = 1;  // a time limit is no terminal state
    result->last = last;
    return OkStatus();
  }

  std::uint64_t state_bytes() const noexcept override { return sizeof(State); }
  Status SaveState(View<std::byte> state) const noexcept override {
    if (state.size != sizeof state_) return WrongSize("state", state.size, sizeof state_);
    std::memcpy(state.data, &state_, sizeof state_);
    return OkStatus();
  }
  Status RestoreState(View<const std::byte> state) noexcept override {
    if (state.size != sizeof state_) {
      return Error(StatusCode::kDataLoss, "expected a state of %zu bytes, found %llu",
                   sizeof state_, static_cast<unsigned long long>(state.size));
    }
    std::memcpy(&state_, state.data, sizeof state_);
    return OkStatus();
  }
  void Destroy() noexcept override { delete this; }

 private:
  // All that Step reads or writes, so that a saved state is the whole state. Fields of eight bytes:
  // no byte of it is padding.
  struct State {
    double x = 0, v = 0;
    std::uint64_t step = 0, under_way = 0;
  };
  static constexpr std::uint32_t kSubsteps = 5;
  static constexpr ObservationPart kParts[] = {{"position", 1}, {"velocity", 1}};
  static constexpr double kLow[] = {-1}, kHigh[] = {1};

  ~PushedBall() = default;

  static Status WrongSize(const char* what, std::uint64_t found, std::uint64_t expected) noexcept {
    return Error(StatusCode::kInvalidArgument, "the %s has %llu entries, expected %llu", what,
                 static_cast<unsigned long long>(found), static_cast<unsigned long long>(expected));
  }
  void Observe(View<double> observation) const noexcept {
    observation[0] = state_.x;
    observation[1] = state_.v;
  }

  const Settings settings_;
  EnvironmentSpec spec_;
  State state_;
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kEnvironment,
    .name = "pushed_ball",
    .version = "1.0.0",
    .summary = "A ball on a line is pushed to the origin, and stays there",
    .parameters = kSettings.declared(),
    .create_environment = CreateEnvironment<PushedBall>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("pushed_ball", "1.0.0", dreamsearch::kComponents)
