// model.h - the interface a model plugin implements.
//
// A model has two faces. LatentModel is what a planner sees: from latents it
// imagines transitions, estimates values and proposes actions. Model adds what
// only the host calls: observe, train, save, load.
//
// Shapes   batch first everywhere: B rows of latents, actions [B, A]. A latent is
//          opaque: copy it, keep it, hand it back to the model it came from.
// Units    actions lie in [-1, 1]. A reward is that of one *decision*: summed over
//          the action repeat. value(s) is the discounted sum of the rewards still
//          to come after s; the reward for arriving at s is not in it.
// Rows     a row's answer is a function of the model's parameters and of the row's own
//          latent, action, observation, environment state and seed. The rows beside it,
//          their number and its place among them change not one bit of it. So a request
//          has a seed for each row, and whoever has several requests of one kind may
//          make them one; the host does.
// Memory   views belong to the caller and are valid only during the call.
// Threads  one thread drives an instance at a time; instances share nothing. A model
//          may use threads of its own inside a call, see SetThreads.
// Errors   every call returns a Status and lets no exception out. A model that
//          finds a latent of its own not finite returns kNotFinite. Laws M1-M14: sdk/README.md.
#pragma once

#include <cstdint>

#include "dreamsearch/extension.h"
#include "dreamsearch/parameter.h"
#include "dreamsearch/sized.h"
#include "dreamsearch/status.h"
#include "dreamsearch/stream.h"
#include "dreamsearch/view.h"

namespace dreamsearch {

class Environment;

// A batch of imagined transitions. A row's seed decides its every draw; a model whose
// transitions are deterministic ignores it.
struct ImagineRequest {
  ConstLatents latents;              // [B, latent_bytes]
  MatrixView<const double> actions;  // [B, A]
  View<const std::uint64_t> seeds;   // [B]
  std::uint64_t struct_size = sizeof(ImagineRequest);
};

struct ImagineResult {
  Latents latents;         // [B, latent_bytes]: s' (must not overlap the request's)
  View<double> rewards;    // [B]: r(s')
  View<double> discounts;  // [B]: gamma, times the modelled chance to continue
  std::uint64_t struct_size = sizeof(ImagineResult);
};

class LatentModel {
 public:
  virtual std::uint64_t latent_bytes() const noexcept = 0;  // a multiple of kLatentAlignment
  virtual std::uint64_t action_size() const noexcept = 0;   // A

  // s' and r(s') for every row (M3: all set; M4, M5: rows; M10: memory).
  virtual Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept = 0;

  // v(s) for every row. values: [B].
  virtual Status Value(ConstLatents latents, View<double> values) noexcept = 0;

  // The mode of the actor at every latent. actions: [B, A].
  virtual Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept = 0;

  // n samples of the actor at every latent. seeds: [B]; actions: [B * n, A], the
  // samples of latent i, drawn from seeds[i], in rows i * n ... i * n + n - 1.
  virtual Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                                MatrixView<double> actions) noexcept = 0;

  // The extension of that name, ValueSpread, ReturnGradient or TensorExport; null: not offered.
  virtual void* Extension(const char* name) noexcept {
    static_cast<void>(name);
    return nullptr;
  }

 protected:
  ~LatentModel() = default;
};

// The estimated values of a batch of latents, by an ensemble.
struct SpreadResult {
  View<double> values;        // [B]: those of Value, to the bit
  View<double> deviations{};  // [B]: standard deviation over the ensemble; empty: not asked for
  View<double> least{};       // [B]: the least of the ensemble; empty: not asked for
  std::uint64_t struct_size = sizeof(SpreadResult);
};

// Whether there is room for `rows` values, and as much or none for what is optional.
inline bool HasRoom(const SpreadResult& result, std::uint64_t rows) noexcept {
  return result.values.size == rows &&
         (result.deviations.empty() || result.deviations.size == rows) &&
         (result.least.empty() || result.least.size == rows);
}

// Extension of a model that estimates values with an ensemble: how far its members are apart.
class ValueSpread {
 public:
  static constexpr const char* kName = "value_spread/1";

  virtual Status Spread(ConstLatents latents, const SpreadResult& result) noexcept = 0;

 protected:
  ~ValueSpread() = default;
};

// B sequences of H actions from B latents.
struct GradientRequest {
  ConstLatents latents;              // [B, latent_bytes]: where the sequences begin
  MatrixView<const double> actions;  // [B * H, A]: row b * H + t is action t of sequence b
  View<const std::uint64_t> seeds;   // [B * H]: of the transitions, as in ImagineRequest
  // The value after the last action: the ensemble's mean and so many of its deviations, or its
  // least. A model without ValueSpread has no deviation, and its value is the least.
  double deviations = 0;
  bool least = false;
  std::uint64_t struct_size = sizeof(GradientRequest);
};

struct GradientResult {
  View<double> returns;          // [B]
  MatrixView<double> gradients;  // [B * H, A]: of each return with respect to its own actions
  std::uint64_t struct_size = sizeof(GradientResult);
};

// Extension of a model that is differentiable: the return of imagined sequences,
//
//     sum over t < H of (d_1 ... d_t) r_{t+1}  +  (d_1 ... d_H) v(s_H)
//
// with the rewards and discounts that Imagine gives for these actions and seeds and the value of
// the last latent, and its gradient with respect to the actions: through transitions, rewards,
// discounts, value and, if the value asks the actor, through the actor. The law of rows holds
// for sequences. Declared by the trait kGivesGradients.
class ReturnGradient {
 public:
  static constexpr const char* kName = "return_gradient/1";

  virtual Status Gradient(const GradientRequest& request,
                          const GradientResult& result) noexcept = 0;

 protected:
  ~ReturnGradient() = default;
};

// One decision's belief update. `previous` and `action` lead to `observation`;
// at an episode's start pass the latent of InitialLatent and a zero action.
struct ObserveRequest {
  ConstLatents previous;                  // [B, latent_bytes]
  MatrixView<const double> actions;       // [B, A]
  MatrixView<const double> observations;  // [B, O]
  // [B, state_bytes]: the environment's saved state, only for a model whose
  // descriptor has kNeedsEnvironment; otherwise empty.
  MatrixView<const std::byte> environment_states;
  View<const std::uint64_t> seeds;  // [B]
  std::uint64_t struct_size = sizeof(ObserveRequest);
};

// B sequences of T consecutive decisions. Where an episode is shorter than T, its sequences run
// on into another one: is_first says where. Row b * T + t belongs to time t of sequence b;
// action and reward are those that *led to* the observation of the same row, zero where it is
// an episode's first.
struct SequenceBatch {
  std::uint64_t sequences = 0;           // B
  std::uint64_t length = 0;              // T
  MatrixView<const float> observations;  // [B * T, O]
  MatrixView<const float> actions;       // [B * T, A]
  View<const float> rewards;             // [B * T]
  View<const float> discounts;           // [B * T]: 0 at a terminal state, else 1
  View<const std::uint8_t> is_first;     // [B * T]: 1 at an episode's first observation
  // The searches that the host kept, only for a model that declares kLearnsFromSearch; otherwise
  // K is 0. A row's search is the one made from its observation: the improved policy and the
  // value that the planner reported (PlanResult). A row whose weights sum to 0 was not searched.
  std::uint64_t search_candidates = 0;     // K
  MatrixView<const float> search_actions;  // [B * T * K, A]
  View<const float> search_weights;        // [B * T * K]
  View<const float> search_values;         // [B * T]
  std::uint64_t struct_size = sizeof(SequenceBatch);
};

struct TrainRequest {
  const SequenceBatch* batch = nullptr;
  std::uint64_t seed = 0;
  std::uint64_t update = 0;            // updates made before this one
  std::uint64_t environment_step = 0;  // environment steps made so far
  std::uint64_t struct_size = sizeof(TrainRequest);
};

class Model : public LatentModel {
 public:
  // The latent before anything was observed. latents: [B, latent_bytes].
  virtual Status InitialLatent(Latents latents) noexcept = 0;

  // The posterior latent. latents: [B, latent_bytes], may not overlap previous.
  virtual Status Observe(const ObserveRequest& request, Latents latents) noexcept = 0;

  // Fits the model and its actor and critic to one batch. metrics: one value for
  // each MetricSpec of the component, in that order.
  // Called only of a model that declares kLearns.
  //   kNotFinite           a loss or a gradient norm is not finite; the message
  //                        names it. The parameters are unchanged.
  virtual Status Train(const TrainRequest& request, View<double> metrics) noexcept = 0;

  // How many threads its calls may use from now on, 1 until it is told; at least 1.
  // Results do not depend on it (M12). May come between any two calls; a model that cannot
  // have as many uses fewer.
  virtual void SetThreads(std::uint32_t threads) noexcept { static_cast<void>(threads); }

  // All that decides the future: parameters, optimiser moments, statistics,
  // counters. Load brings back the very bits.
  virtual Status Save(ByteSink* sink) const noexcept = 0;
  //   kDataLoss            not what Save wrote for these settings; the model is unusable.
  virtual Status Load(ByteSource* source) noexcept = 0;

  virtual void Destroy() noexcept = 0;

 protected:
  ~Model() = default;
};

// Extension: hands out the parameters, for `runner export`.
class TensorExport {
 public:
  static constexpr const char* kName = "export/1";

  // Hands every parameter array to the sink, named and shaped.
  virtual Status Export(TensorSink* sink) const noexcept = 0;

 protected:
  ~TensorExport() = default;
};

}  // namespace dreamsearch
