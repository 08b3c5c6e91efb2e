// probe_environment.h - a task of any size, for models that need an environment.
//
// Four numbers drift with the action; every observation is a mixture of them. Episodes have 20
// steps. Its whole state can be saved.
#pragma once

#include <cstdint>
#include <vector>

#include "dreamsearch/environment.h"
#include "tools.h"

namespace dreamsearch::check {

class ProbeEnvironment final : public Offers<Environment, StateSaving> {
 public:
  ProbeEnvironment(std::uint64_t observation_size, std::uint64_t action_size);
  ProbeEnvironment(const ProbeEnvironment&) = delete;
  ProbeEnvironment& operator=(const ProbeEnvironment&) = delete;

  static constexpr std::uint32_t kEpisodeSteps = 20;

  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t seed, View<double> observation) noexcept override;
  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override;
  std::uint64_t state_bytes() const noexcept override { return sizeof(State); }
  Status SaveState(View<std::byte> state) const noexcept override;
  Status RestoreState(View<const std::byte> state) noexcept override;
  void Destroy() noexcept override {}  // whoever made it owns it

 private:
  struct State {
    double x[4] = {};
    std::uint64_t step = 0;
  };
  void Observe(View<double> observation) const;

  std::vector<double> low_, high_;
  ObservationPart part_;
  EnvironmentSpec spec_;
  State state_;
};

}  // namespace dreamsearch::check
