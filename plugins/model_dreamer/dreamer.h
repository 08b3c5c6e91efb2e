// dreamer.h - the Dreamer agent behind the SDK's Model interface.
//
// A latent's state is [z, h]. After a call has seen its largest batch it allocates nothing.
#pragma once

#include "dreamsearch/plugin.h"
#include "plugins/model_dreamer/followed.h"
#include "plugins/model_dreamer/learner.h"
#include "plugins/networks/float_model.h"

namespace dreamsearch::dreamer {

// What Train reports, in this order.
View<const MetricSpec> DeclaredMetrics();

class Dreamer final : public FloatModel {
 public:
  Dreamer(const Settings& settings, Index observation_size, Index action_size, std::uint64_t seed);

  void SetThreads(std::uint32_t threads) noexcept override { learner_.SetThreads(threads); }
  Learner<float>& learner() { return learner_; }

 private:
  ~Dreamer() override = default;

  void Step(In<float> states, In<float> actions, In<float> noise, Mat<float> next,
            Mat<float> rewards, double* discounts) override;
  void Values(In<float> states, Mat<float> values) override;
  void Act(In<float> states, Index each, In<float> noise, Mat<float> actions) override;
  void Believe(In<float> previous, In<float> actions, const double* observations, In<float> noise,
               Mat<float> next) override;
  void Follow(In<float> states, In<float> actions, In<float> noise, Mat<float> rewards,
              double* discounts, Mat<float> values) override;
  void FollowBackward(In<float> d_rewards, In<float> d_discounts, In<float> d_values,
                      Mat<float> d_actions) override;
  Status Update(const TrainRequest& request, double* metrics) override;
  Status SaveTo(ByteSink* sink) const override { return learner_.Save(sink); }
  Status LoadFrom(ByteSource* source) override { return learner_.Load(source); }
  Status ExportTo(TensorSink* sink) const override { return learner_.Export(sink); }

  Learner<float> learner_;
  Followed<float> followed_;
  In<float> followed_noise_;  // of the last Follow
  TransitionTape<float> transitions_;
  MlpTape<float> head_tape_, continuation_tape_;
  Bfloat16Scratch rounded_scratch_;
  Buffer<float> observations_, logits_;
};

// The component's factory.
Status CreateDreamer(const ModelContext& context, Model** result) noexcept;

}  // namespace dreamsearch::dreamer
