// python_environment.h - an environment of Gymnasium or dm_control as the SDK's Environment.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "dreamsearch/environment.h"
#include "plugins/env_gym/python_process.h"

namespace dreamsearch::gym {

struct PythonEnvironmentSettings {
  std::string kind;                 // "gym" or "dm", see bridge.py
  std::string interpreter;          // path, or name in PATH
  std::string module;               // "" for a registered environment
  std::string id;                   // Hopper-v5; walker-walk; a class in `module`
  std::string arguments;            // keyword arguments, a JSON object
  double action_low = 0;            // instead of infinite bounds, where it is
  double action_high = 0;           //   below action_high
  std::uint32_t episode_steps = 0;  // time limit; 0: the environment's own, or 1,000
};

class PythonEnvironment final : public Offers<Environment, StateSaving, Rendering> {
 public:
  // Starts the interpreter and makes the environment. What goes wrong is thrown: ProcessError,
  // EnvironmentError, std::invalid_argument.
  explicit PythonEnvironment(const PythonEnvironmentSettings& settings);

  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t seed, View<double> observation) noexcept override;
  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override;
  // By the environment's own save_state and restore_state, if it has them; else a state is the
  // episode's seed and actions, and going to it plays them again.
  std::uint64_t state_bytes() const noexcept override { return state_bytes_; }
  Status SaveState(View<std::byte> state) const noexcept override;
  Status RestoreState(View<const std::byte> state) noexcept override;
  Status Render(const RenderRequest& request, View<std::uint8_t> rgb) noexcept override;
  void Destroy() noexcept override { delete this; }

 private:
  Status CheckRoom(const char* call, View<double> observation) const noexcept;
  struct StateHeader;

  ~PythonEnvironment() = default;
  Status Start(std::uint32_t seed, View<double> observation);
  Status Advance(View<const double> action, View<double> observation, StepResult* result);
  Status Observe(std::string_view numbers, View<double> observation) const;
  // Runs `call`; an exception becomes the Status of the episode's end.
  template <typename Call>
  Status Guarded(const char* what, const Call& call) noexcept;

  PythonEnvironmentSettings settings_;
  std::unique_ptr<PythonProcess> process_;
  EnvironmentSpec spec_;
  std::vector<std::string> names_;
  std::vector<ObservationPart> parts_;
  std::map<std::string, std::string> made_of_;
  std::vector<Ingredient> ingredients_;
  std::string notice_;
  std::vector<double> low_, high_;
  std::uint64_t own_state_bytes_ = 0;  // 0: states are replayed
  std::uint64_t state_bytes_ = 0;

  bool running_ = false;
  std::uint32_t seed_ = 0;
  std::uint32_t steps_ = 0;
  std::vector<double> actions_;  // of this episode, in the environment's bounds
};

}  // namespace dreamsearch::gym
