// float_model.h - what models of float networks do alike behind the SDK's Model: sizes are
// checked, numbers become float and back, requests go through in blocks, what is not finite
// is found, exceptions stay inside.
//
// A latent is a state of S floats, padded with zeros to a multiple of kLatentAlignment
// bytes. A derived class computes on columns: states [S, n], actions [A, n], observations
// as they came. A column must not depend on those beside it. After a call has seen its
// largest batch it allocates nothing, if the derived class does not.
#pragma once

#include "dreamsearch/plugin.h"
#include "plugins/networks/elementwise.h"
#include "plugins/networks/layers.h"

namespace dreamsearch::networks {

class FloatModel : public Offers<Model, ValueSpread, ReturnGradient, TensorExport> {
 public:
  std::uint64_t latent_bytes() const noexcept final { return latent_bytes_; }
  std::uint64_t action_size() const noexcept final { return static_cast<std::uint64_t>(a_); }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept final;
  Status Value(ConstLatents latents, View<double> values) noexcept final;
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept final;
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept final;
  // Not offered where there is one critic.
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept final;
  void* Extension(const char* name) noexcept final;
  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept final;
  Status InitialLatent(Latents latents) noexcept final;  // zeros
  Status Observe(const ObserveRequest& request, Latents latents) noexcept final;
  Status Train(const TrainRequest& request, View<double> metrics) noexcept final;
  Status Save(ByteSink* sink) const noexcept final;
  Status Load(ByteSource* source) noexcept final;
  Status Export(TensorSink* sink) const noexcept final;
  void Destroy() noexcept final { delete this; }

 protected:
  struct Sizes {
    Index state = 0;         // S
    Index observation = 0;   // O
    Index action = 0;        // A
    Index critics = 1;       // values a state
    Index metrics = 0;       // of Train
    Index step_noise = 0;    // normal draws an imagined transition
    Index belief_noise = 0;  // normal draws an observation
  };
  explicit FloatModel(const Sizes& sizes);
  virtual ~FloatModel() = default;

  // Noise is empty where no draws were asked for. rewards: [1, n]; discounts: [n].
  virtual void Step(In<float> states, In<float> actions, In<float> noise, Mat<float> next,
                    Mat<float> rewards, double* discounts) = 0;
  // values: [critics, n].
  virtual void Values(In<float> states, Mat<float> values) = 0;
  // The mode where noise is empty; else `each` actions a state, [A, n * each].
  virtual void Act(In<float> states, Index each, In<float> noise, Mat<float> actions) = 0;
  // observations: [n, O] row-major.
  virtual void Believe(In<float> previous, In<float> actions, const double* observations,
                       In<float> noise, Mat<float> next) = 0;
  // The transitions of n sequences of actions, time-major: column t * n + i is transition t of
  // sequence i. rewards: [1, H * n]; discounts: [H * n]; values: [critics, n], of the last states.
  virtual void Follow(In<float> states, In<float> actions, In<float> noise, Mat<float> rewards,
                      double* discounts, Mat<float> values) = 0;
  // The way back of the last Follow, from the gradients of what it gave.
  virtual void FollowBackward(In<float> d_rewards, In<float> d_discounts, In<float> d_values,
                              Mat<float> d_actions) = 0;
  virtual Status Update(const TrainRequest& request, double* metrics) = 0;
  virtual Status SaveTo(ByteSink* sink) const = 0;
  virtual Status LoadFrom(ByteSource* source) = 0;
  virtual Status ExportTo(TensorSink* sink) const = 0;

 private:
  // The latents as states without the padding; borrowed from `latents`.
  Mat<const float> StatesOf(ConstLatents latents) const;
  Status CheckLatents(const char* call, std::uint64_t cols, std::uint64_t rows,
                      std::uint64_t expected_rows) const;
  Status CheckActions(const char* call, MatrixView<const double> actions, std::uint64_t rows) const;
  Status WriteLatents(const char* call, Mat<const float> states, Latents latents) const;
  Mat<float> Actions(MatrixView<const double> actions);
  // [rows, seeds * each]: the `each` columns from i * each on are drawn from seeds[i]; empty
  // for no rows.
  Mat<float> Noise(View<const std::uint64_t> seeds, Index rows, Index each = 1);

  const Sizes sizes_;
  const Index a_;
  const std::uint64_t latent_bytes_;
  // A block of a Gradient, from its first sequence on.
  void GradientOf(Index first, Mat<const float> states, Mat<const float> actions,
                  Mat<const float> noise, const GradientRequest& request,
                  const GradientResult& result);

  Buffer<float> actions_, states_, noise_, rewards_, values_;
  Buffer<float> block_actions_, block_noise_, d_rewards_, d_discounts_, d_values_, d_actions_;
  Buffer<double> discounts_, after_;
};

// Runs a call that may throw (memory) behind the plugin boundary.
Status Guarded(const char* name, Status (*call)(void* context), void* context) noexcept;
template <typename Call>
Status Guarded(const char* name, Call call) noexcept {
  return Guarded(
      name, [](void* context) { return (*static_cast<Call*>(context))(); }, &call);
}

// kInvalidArgument where a task has no observation or no action.
Status CheckTask(const char* model, const ModelContext& context);

}  // namespace dreamsearch::networks
