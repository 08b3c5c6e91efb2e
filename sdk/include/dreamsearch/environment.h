// environment.h - the interface an environment plugin implements.
//
// An environment is one control task: it is reset from a seed, stepped with
// actions, and says what it observed and what reward it gave.
//
// Shapes   O = observation_size, A = action_size.
// Units    actions lie in the environment's own bounds [action_low, action_high];
//          ToEnvironmentBounds maps [-1, 1] to them. One Step is one *environment
//          step*: a control step of the simulator, before any action repeat.
// Memory   views belong to the caller and are valid only during the call; what
//          spec() points to lives as long as the environment.
// Threads  one thread drives an instance at a time; instances share nothing.
// Errors   every call returns a Status and lets no exception out. NaN in an
//          action is kInvalidArgument, never a zero control. Laws E1-E9: sdk/README.md.
#pragma once

#include <cstdint>

#include "dreamsearch/extension.h"
#include "dreamsearch/sized.h"
#include "dreamsearch/status.h"
#include "dreamsearch/view.h"

namespace dreamsearch {

// One named part of the observation; the parts are laid end to end.
struct ObservationPart {
  const char* name = nullptr;
  std::uint64_t size = 0;
  // Later fields go here.
};

// Something beside plugin and settings that decides the episodes: {"numpy", "2.1.3"}, a file that
// was read and its SHA-256.
struct Ingredient {
  const char* name = nullptr;
  const char* value = nullptr;
  // Later fields go here.
};

struct EnvironmentSpec {
  Records<ObservationPart> observation;
  std::uint64_t observation_size = 0;  // O
  std::uint64_t action_size = 0;       // A
  View<const double> action_low;       // [A]
  View<const double> action_high;      // [A]
  double control_seconds = 0;          // simulated seconds of one environment step
  std::uint32_t substeps = 1;          // physics steps in one environment step
  std::uint32_t episode_steps = 0;     // environment steps until the time limit
  bool terminates = false;             // it has terminal states: a discount can be 0
  double return_low = 0;               // range of an episode's return, for normalised
  double return_high = 0;              //   scores; equal when there is none
  // Stored with a run, each under another name. One that changed counts as a changed plugin: an
  // unfinished run does not go on with it.
  Records<Ingredient> ingredients;
  // One line that a person should read before a run, about what was assumed; may be null.
  const char* notice = nullptr;
  std::uint64_t struct_size = sizeof(EnvironmentSpec);
};

// What one step gave. `discount` is 0 at a terminal state and 1 elsewhere, the
// time limit included; `last` says that the episode is over, after episode_steps at the
// latest: a run whose episode goes on is refused. It comes with these values: set each field alone.
struct StepResult {
  double reward = 0;
  double discount = 1;
  bool last = false;
  std::uint64_t struct_size = sizeof(StepResult);

  StepResult& operator=(const StepResult&) = delete;  // the caller's may be shorter
};

class Environment {
 public:
  virtual const EnvironmentSpec& spec() const noexcept = 0;

  // Starts an episode (E6). Equal seeds give equal episodes for equal actions,
  // whatever happened before. observation: [O].
  virtual Status Reset(std::uint32_t seed, View<double> observation) noexcept = 0;

  // Advances one environment step. action: [A]; observation: [O].
  //   kFailedPrecondition  no episode is under way.
  //   kInvalidArgument     a view has the wrong size, or the action is not finite.
  //   kDiverged            the simulator warned; the episode is over.
  virtual Status Step(View<const double> action, View<double> observation,
                      StepResult* result) noexcept = 0;

  // The extension of that name, StateSaving or Rendering; null: not offered.
  virtual void* Extension(const char* name) noexcept {
    static_cast<void>(name);
    return nullptr;
  }

  virtual void Destroy() noexcept = 0;

 protected:
  ~Environment() = default;
};

// Extension: saves and restores the state. Without it a run that is resumed inside an episode
// plays that episode again up to where it was, and the oracle cannot plan.
class StateSaving {
 public:
  static constexpr const char* kName = "state/1";

  virtual std::uint64_t state_bytes() const noexcept = 0;  // never changes

  // Copies the whole state, `state_bytes` long: restoring it and stepping gives
  // the very bits that stepping on would have given.
  virtual Status SaveState(View<std::byte> state) const noexcept = 0;

  // Goes to a state that SaveState wrote on an environment of the same task.
  //   kDataLoss            the bytes are not such a state; the environment is unchanged.
  virtual Status RestoreState(View<const std::byte> state) noexcept = 0;

 protected:
  ~StateSaving() = default;
};

// A picture of the current state: rows of RGB bytes, top row first.
struct RenderRequest {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t camera = 0;
  std::uint64_t struct_size = sizeof(RenderRequest);
};

// Extension: draws pictures, for `runner render`, `explain` and `results report`.
class Rendering {
 public:
  static constexpr const char* kName = "render/1";

  // Draws the current state into width * height * 3 bytes.
  virtual Status Render(const RenderRequest& request, View<std::uint8_t> rgb) noexcept = 0;

 protected:
  ~Rendering() = default;
};

// Maps an action from [-1, 1]^A affinely to the environment's own bounds. The
// ends are met exactly; values outside [-1, 1] are clipped first.
inline void ToEnvironmentBounds(const EnvironmentSpec& spec, View<const double> action,
                                View<double> bounded) noexcept {
  for (std::uint64_t i = 0; i < action.size; ++i) {
    const double low = spec.action_low[i];
    const double high = spec.action_high[i];
    const double a = action[i];
    if (a <= -1) {
      bounded[i] = low;
    } else if (a >= 1) {
      bounded[i] = high;
    } else {
      bounded[i] = low + (high - low) * (0.5 * (a + 1));
    }
  }
}

}  // namespace dreamsearch
