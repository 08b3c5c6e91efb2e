// scripted_model.h - models whose transitions, rewards and values are closed forms.
#pragma once

#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/random.h"

namespace dreamsearch {

// A latent is a state of eight numbers.
struct alignas(64) ScriptedState {
  double x[8] = {};
  bool operator==(const ScriptedState&) const = default;
};
static_assert(sizeof(ScriptedState) == kLatentAlignment);

inline ConstLatents AsLatents(const ScriptedState& state) {
  return {reinterpret_cast<const std::byte*>(&state), 1, sizeof state};
}

struct ScriptedTransition {
  ScriptedState next;
  double reward = 0;
  double discount = 1;
};

// Plans the model of the three functions; the actor's mode is zero and its samples
// are uniform unless given. Counts what it is asked for.
class ScriptedModel : public LatentModel {
 public:
  using Action = View<const double>;

  std::uint64_t actions = 1;  // A
  std::function<ScriptedTransition(const ScriptedState&, Action)> transition;
  std::function<double(const ScriptedState&)> value = [](const ScriptedState&) { return 0.0; };
  std::function<void(const ScriptedState&, View<double>)> mode =
      [](const ScriptedState&, View<double> action) {
        for (double& a : action) a = 0;
      };
  std::function<void(const ScriptedState&, Random&, View<double>)> sample =
      [](const ScriptedState&, Random& random, View<double> action) {
        for (double& a : action) a = random.Uniform(-1, 1);
      };

  // Fails the call after this many successful ones.
  std::optional<std::uint64_t> fail_after;
  Status failure = Error(StatusCode::kInternal, "scripted failure");

  std::uint64_t calls = 0;
  std::uint64_t transitions = 0;
  std::uint64_t imagine_calls = 0;
  std::uint64_t values_asked = 0;
  std::uint64_t samples_asked = 0;
  std::uint64_t modes_asked = 0;

  std::uint64_t latent_bytes() const noexcept override { return sizeof(ScriptedState); }
  std::uint64_t action_size() const noexcept override { return actions; }

  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    if (Fails()) return failure;
    ++imagine_calls;
    for (std::uint64_t i = 0; i < request.latents.rows; ++i) {
      const ScriptedTransition step =
          transition(State(request.latents, i), request.actions.row(i));
      std::memcpy(result.latents.row(i).data, &step.next, sizeof step.next);
      result.rewards[i] = step.reward;
      result.discounts[i] = step.discount;
    }
    transitions += request.latents.rows;
    return OkStatus();
  }

  Status Value(ConstLatents latents, View<double> values) noexcept override {
    if (Fails()) return failure;
    for (std::uint64_t i = 0; i < latents.rows; ++i) values[i] = value(State(latents, i));
    values_asked += latents.rows;
    return OkStatus();
  }

  Status ProposeMode(ConstLatents latents, MatrixView<double> out) noexcept override {
    if (Fails()) return failure;
    for (std::uint64_t i = 0; i < latents.rows; ++i) mode(State(latents, i), out.row(i));
    modes_asked += latents.rows;
    return OkStatus();
  }

  Status ProposeSamples(ConstLatents latents, std::uint64_t seed,
                        MatrixView<double> out) noexcept override {
    if (Fails()) return failure;
    Random random(seed);
    const std::uint64_t each = out.rows / latents.rows;
    for (std::uint64_t i = 0; i < out.rows; ++i) {
      sample(State(latents, i / each), random, out.row(i));
    }
    samples_asked += out.rows;
    return OkStatus();
  }

 private:
  static ScriptedState State(ConstLatents latents, std::uint64_t row) {
    ScriptedState state;
    std::memcpy(&state, latents.row(row).data, sizeof state);
    return state;
  }
  bool Fails() { return fail_after.has_value() && calls++ >= *fail_after; }
};

// Every state pays f(a) for action a, and nothing depends on the state.
inline ScriptedModel Bandit(std::function<double(double)> pay, double discount) {
  ScriptedModel model;
  model.transition = [pay, discount](const ScriptedState& state, ScriptedModel::Action action) {
    return ScriptedTransition{state, pay(action[0]), discount};
  };
  return model;
}

// A walk on the integers from 0: an action above 0 steps right, any other left.
// Arriving at -1 pays 1 and ends, arriving at 3 pays 10 and ends; nothing else
// pays. With discount 0.9 the values are exact: v(2) = 10, v(1) = 9, v(0) = 8.1,
// so that at 0 stepping right is worth 0.9 * 9 = 8.1 and left 1.
struct Chain {
  static constexpr double kDiscount = 0.9;
  static double Value(double position) {
    if (position <= -1 || position >= 3) return 0;
    return 10 * std::pow(kDiscount, 2 - position);
  }
  // The critic is exact; the actor's mode goes right or, if `wrong_mode`, left.
  static ScriptedModel Model(bool wrong_mode) {
    ScriptedModel model;
    model.transition = [](const ScriptedState& state, ScriptedModel::Action action) {
      ScriptedTransition step;
      const double to = state.x[0] + (action[0] > 0 ? 1 : -1);
      const bool over = to <= -1 || to >= 3;
      step.next.x[0] = to;
      step.reward = to <= -1 ? 1 : to >= 3 ? 10 : 0;
      step.discount = over ? 0 : kDiscount;
      return step;
    };
    model.value = [](const ScriptedState& state) { return Value(state.x[0]); };
    model.mode = [wrong_mode](const ScriptedState&, View<double> action) {
      action[0] = wrong_mode ? -0.5 : 0.5;
    };
    return model;
  }
};

}  // namespace dreamsearch
