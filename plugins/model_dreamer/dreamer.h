// dreamer.h - the Dreamer agent behind the SDK's Model interface.
//
// A latent is [z, h] in float, padded with zeros to a multiple of
// kLatentAlignment bytes. After a call has seen its largest batch it allocates
// nothing.
#pragma once

#include "dreamsearch/plugin.h"
#include "plugins/model_dreamer/learner.h"

namespace dreamsearch::dreamer {

// What Train reports, in this order.
View<const MetricSpec> DeclaredMetrics();

class Dreamer final : public Model {
 public:
  Dreamer(const Settings& settings, Index observation_size, Index action_size, std::uint64_t seed);

  std::uint64_t latent_bytes() const noexcept override { return latent_bytes_; }
  std::uint64_t action_size() const noexcept override {
    return static_cast<std::uint64_t>(learner_.action_size());
  }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override;
  Status Value(ConstLatents latents, const ValueResult& result) noexcept override;
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override;
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override;

  Status InitialLatent(Latents latents) noexcept override;
  Status Observe(const ObserveRequest& request, Latents latents) noexcept override;
  Status Train(const TrainRequest& request, View<double> metrics) noexcept override;
  void SetThreads(std::uint32_t threads) noexcept override { learner_.SetThreads(threads); }
  Status Save(ByteSink* sink) const noexcept override;
  Status Load(ByteSource* source) noexcept override;
  Status Export(TensorSink* sink) const noexcept override;
  void Destroy() noexcept override { delete this; }

  const Learner<float>& learner() const { return learner_; }

 private:
  ~Dreamer() = default;

  // The latents as states [Z + D, B], without the padding; borrowed from
  // `latents`.
  Mat<const float> StatesOf(ConstLatents latents) const;
  Status CheckLatents(const char* call, std::uint64_t cols, std::uint64_t rows,
                      std::uint64_t expected_rows) const;
  Status WriteLatents(const char* call, Mat<const float> states, Latents latents) const;
  // [rows, seeds * each]: the `each` columns from i * each on are drawn from seeds[i].
  Mat<float> Noise(View<const std::uint64_t> seeds, Index rows, Index each = 1);

  Learner<float> learner_;
  std::uint64_t latent_bytes_;
  TransitionTape<float> transitions_;
  MlpTape<float> head_tape_, continuation_tape_;
  Bfloat16Scratch rounded_scratch_;
  Buffer<float> actions_, observations_, states_, noise_, rewards_, logits_, values_;
};

// The component's factory.
Status CreateDreamer(const ModelContext& context, Model** result) noexcept;

}  // namespace dreamsearch::dreamer
