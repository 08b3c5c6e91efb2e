// scripted_model.h - models whose transitions, rewards and values are closed forms.
#pragma once

#include <algorithm>
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
class ScriptedModel : public Offers<LatentModel, ValueSpread, ReturnGradient> {
 public:
  using Action = View<const double>;

  std::uint64_t actions = 1;  // A
  std::function<ScriptedTransition(const ScriptedState&, Action)> transition;
  std::function<double(const ScriptedState&)> value = [](const ScriptedState&) { return 0.0; };
  // Of an ensemble whose least value is the mean less one deviation; none where empty.
  std::function<double(const ScriptedState&)> deviation;
  std::function<void(const ScriptedState&, View<double>)> mode = [](const ScriptedState&,
                                                                    View<double> action) {
    for (double& a : action) a = 0;
  };
  std::function<void(const ScriptedState&, Random&, View<double>)> sample =
      [](const ScriptedState&, Random& random, View<double> action) {
        for (double& a : action) a = random.Uniform(-1, 1);
      };

  bool gives_gradients = true;  // by central differences of the functions

  // Fails the call after this many successful ones.
  std::optional<std::uint64_t> fail_after;
  Status failure = Error(StatusCode::kInternal, "scripted failure");

  std::uint64_t calls = 0;
  std::uint64_t transitions = 0;
  std::uint64_t imagine_calls = 0;
  std::uint64_t gradients_asked = 0;  // transitions
  std::uint64_t values_asked = 0;
  std::uint64_t samples_asked = 0;
  std::uint64_t modes_asked = 0;

  std::uint64_t latent_bytes() const noexcept override { return sizeof(ScriptedState); }
  std::uint64_t action_size() const noexcept override { return actions; }

  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    if (Fails()) return failure;
    ++imagine_calls;
    for (std::uint64_t i = 0; i < request.latents.rows; ++i) {
      const ScriptedTransition step = transition(State(request.latents, i), request.actions.row(i));
      std::memcpy(result.latents.row(i).data, &step.next, sizeof step.next);
      result.rewards[i] = step.reward;
      result.discounts[i] = step.discount;
    }
    transitions += request.latents.rows;
    return OkStatus();
  }

  // The spread is offered where there is an ensemble.
  void* Extension(const char* name) noexcept override {
    if (!deviation && std::strcmp(name, ValueSpread::kName) == 0) return nullptr;
    if (!gives_gradients && std::strcmp(name, ReturnGradient::kName) == 0) return nullptr;
    return Offers::Extension(name);
  }

  Status Value(ConstLatents latents, View<double> values) noexcept override {
    return Spread(latents, {.values = values});
  }

  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override {
    if (Fails()) return failure;
    for (std::uint64_t i = 0; i < latents.rows; ++i) result.values[i] = value(State(latents, i));
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      const double spread = deviation ? deviation(State(latents, i)) : 0;
      if (!result.deviations.empty()) result.deviations[i] = spread;
      if (!result.least.empty()) result.least[i] = result.values[i] - spread;
    }
    values_asked += latents.rows;
    return OkStatus();
  }

  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept override {
    if (Fails()) return failure;
    constexpr double kStep = 1e-5;
    const std::uint64_t steps = request.actions.rows / request.latents.rows;
    actions_.assign(request.actions.data, request.actions.data + request.actions.size());
    for (std::uint64_t i = 0; i < request.latents.rows; ++i) {
      result.returns[i] = Return(request, i, steps);
      for (std::uint64_t k = i * steps * actions; k < (i + 1) * steps * actions; ++k) {
        const double kept = actions_[k];
        actions_[k] = kept + kStep;
        const double above = Return(request, i, steps);
        actions_[k] = kept - kStep;
        const double below = Return(request, i, steps);
        actions_[k] = kept;
        result.gradients.data[k] = (above - below) / (2 * kStep);
      }
    }
    gradients_asked += request.actions.rows;
    return OkStatus();
  }

  Status ProposeMode(ConstLatents latents, MatrixView<double> out) noexcept override {
    if (Fails()) return failure;
    for (std::uint64_t i = 0; i < latents.rows; ++i) mode(State(latents, i), out.row(i));
    modes_asked += latents.rows;
    return OkStatus();
  }

  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> out) noexcept override {
    if (Fails()) return failure;
    const std::uint64_t each = out.rows / latents.rows;
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      Random random(seeds[i]);
      for (std::uint64_t j = 0; j < each; ++j) {
        sample(State(latents, i), random, out.row(i * each + j));
      }
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
  // Of sequence i with actions_.
  double Return(const GradientRequest& request, std::uint64_t i, std::uint64_t steps) {
    ScriptedState state = State(request.latents, i);
    way_.clear();
    for (std::uint64_t t = 0; t < steps; ++t) {
      way_.push_back(transition(state, {actions_.data() + (i * steps + t) * actions, actions}));
      state = way_.back().next;
    }
    double total = value(state);
    if (deviation) {
      total += request.least ? -deviation(state) : request.deviations * deviation(state);
    }
    for (std::uint64_t t = steps; t-- > 0;) total = way_[t].reward + way_[t].discount * total;
    return total;
  }
  std::vector<double> actions_;  // of the request whose gradient is asked
  std::vector<ScriptedTransition> way_;

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

// The scalar linear-quadratic problem s' = s + a / 2, reward -(s'^2 + a^2 / 4),
// discount 0.95, from s = 0.5. Its value is v(s) = -P s^2 and its best action -K s
// (Bertsekas 2012, section 3.1; the cost of arriving counts, so P is without it):
//
//     Q(s, a) = -((1 + gamma P) s'^2 + a^2 / 4),   maximal over a at a = -K s.
struct LinearQuadratic {
  static constexpr double kDiscount = 0.95;
  static constexpr double kGain = 0.5;     // of the action
  static constexpr double kEffort = 0.25;  // price of a^2
  static constexpr double kStart = 0.5;

  // The fixed point of P = min_K (1 + gamma P) (1 - K / 2)^2 + K^2 / 4.
  static double P() {
    double p = 0;
    for (int i = 0; i < 1000; ++i) {
      const double k = K(p);
      p = (1 + kDiscount * p) * (1 - kGain * k) * (1 - kGain * k) + kEffort * k * k;
    }
    return p;
  }
  static double K(double p) {
    const double w = 1 + kDiscount * p;
    return w * kGain / (w * kGain * kGain + kEffort);
  }
  static double Q(double s, double a) {
    const double next = s + kGain * a;
    return -((1 + kDiscount * P()) * next * next + kEffort * a * a);
  }
  // Mean regret of the best of m actions drawn uniformly from [-1, 1], were their Q
  // known. Q is a parabola around the best action, so this is its curvature times
  // E D^2 = integral of 2 d P(D > d)^m, with D the distance of one action from it.
  static double BestOfRandomRegret(double best, int m) {
    const double curvature = (1 + kDiscount * P()) * kGain * kGain + kEffort;
    constexpr int kSteps = 10000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double d = 2 * (i + 0.5) / kSteps;
      const double farther = std::max(0.0, 1 + best - d) + std::max(0.0, 1 - best - d);
      sum += 2 * d * std::pow(farther / 2, m) * (2.0 / kSteps);
    }
    return curvature * sum;
  }

  // The critic is exact, the actor's mode a poor action.
  static ScriptedModel Model() {
    ScriptedModel model;
    model.transition = [](const ScriptedState& state, ScriptedModel::Action action) {
      ScriptedTransition step;
      step.next.x[0] = state.x[0] + kGain * action[0];
      step.reward = -(step.next.x[0] * step.next.x[0] + kEffort * action[0] * action[0]);
      step.discount = kDiscount;
      return step;
    };
    model.value = [p = P()](const ScriptedState& state) { return -p * state.x[0] * state.x[0]; };
    return model;
  }
};

// Two decisions. A first action below 0 pays 0.6 and ends it. Any other pays nothing
// and then a second action above 0 pays 1, any other nothing: of two random actions
// the first looks worse on average (0.5 against 0.6, and so says the critic, exact for
// random actions), and is better.
inline ScriptedModel Deception() {
  ScriptedModel model;
  model.transition = [](const ScriptedState& state, ScriptedModel::Action action) {
    ScriptedTransition step;
    const bool second = state.x[0] == 1;
    const bool over = second || action[0] < 0;
    step.next.x[0] = over ? 2 : 1;
    step.reward = state.x[0] >= 2 ? 0 : second ? (action[0] > 0 ? 1 : 0) : (over ? 0.6 : 0);
    step.discount = over ? 0 : 1;
    return step;
  };
  model.value = [](const ScriptedState& state) { return state.x[0] == 1 ? 0.5 : 0; };
  return model;
}

inline const ScriptedState kRoot;

// The state counts the transitions so far; arriving with count n pays 2^n and is
// worth 1000 + n.
inline ScriptedModel Counter(double discount) {
  ScriptedModel model;
  model.transition = [discount](const ScriptedState& state, ScriptedModel::Action) {
    ScriptedTransition step;
    step.next.x[0] = state.x[0] + 1;
    step.reward = std::exp2(step.next.x[0]);
    step.discount = discount;
    return step;
  };
  model.value = [](const ScriptedState& state) { return 1000 + state.x[0]; };
  return model;
}

}  // namespace dreamsearch
