#include "probe_environment.h"

#include "dreamsearch/random.h"

namespace dreamsearch::check {

ProbeEnvironment::ProbeEnvironment(std::uint64_t observation_size, std::uint64_t action_size)
    : low_(action_size, -2.0), high_(action_size, 1.0), part_{"mixture", observation_size} {
  spec_.observation = Records<ObservationPart>(&part_, 1);
  spec_.observation_size = observation_size;
  spec_.action_size = action_size;
  spec_.action_low = {low_.data(), low_.size()};
  spec_.action_high = {high_.data(), high_.size()};
  spec_.control_seconds = 0.1;
  spec_.episode_steps = kEpisodeSteps;
  spec_.return_low = -2.0 * kEpisodeSteps;
  spec_.return_high = kEpisodeSteps;
}

void ProbeEnvironment::Observe(View<double> observation) const {
  for (std::uint64_t i = 0; i < observation.size; ++i) {
    observation[i] = std::sin(static_cast<double>(1 + i / 4) * state_.x[i % 4]);
  }
}

Status ProbeEnvironment::Reset(std::uint32_t seed, View<double> observation) noexcept {
  Random random(seed);
  for (double& x : state_.x) x = random.Uniform(-1, 1);
  state_.step = 0;
  Observe(observation);
  return OkStatus();
}

Status ProbeEnvironment::Step(View<const double> action, View<double> observation,
                              StepResult* result) noexcept {
  if (action.size != spec_.action_size || observation.size != spec_.observation_size) {
    return Error(StatusCode::kInvalidArgument, "probe: views of other sizes");
  }
  for (std::uint64_t j = 0; j < action.size; ++j) {
    if (!std::isfinite(action[j])) {
      return Error(StatusCode::kInvalidArgument, "probe: an action that is not finite");
    }
    state_.x[j % 4] += 0.1 * std::clamp(action[j], low_[j], high_[j]);
  }
  for (double& x : state_.x) x = 0.95 * std::clamp(x, -3.0, 3.0);
  ++state_.step;
  Observe(observation);
  result->reward = std::cos(state_.x[0]) * 0.9;
  result->discount = 1;
  result->last = state_.step >= kEpisodeSteps;
  return OkStatus();
}

Status ProbeEnvironment::SaveState(View<std::byte> state) const noexcept {
  if (state.size != sizeof state_) return Error(StatusCode::kInvalidArgument, "probe: state size");
  std::memcpy(state.data, &state_, sizeof state_);
  return OkStatus();
}

Status ProbeEnvironment::RestoreState(View<const std::byte> state) noexcept {
  if (state.size != sizeof state_) return Error(StatusCode::kDataLoss, "probe: state size");
  std::memcpy(&state_, state.data, sizeof state_);
  return OkStatus();
}

}  // namespace dreamsearch::check
