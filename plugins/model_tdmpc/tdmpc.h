// tdmpc.h - the agent of TD-MPC2 behind the SDK's Model interface.
//
// A latent's state is z. Transitions and beliefs are deterministic; a state's value is the
// critics' at the actor's mode. After a call has seen its largest batch it allocates nothing.
#pragma once

#include "dreamsearch/plugin.h"
#include "plugins/model_tdmpc/followed.h"
#include "plugins/model_tdmpc/learner.h"
#include "plugins/networks/float_model.h"

namespace dreamsearch::tdmpc {

class Tdmpc final : public FloatModel {
 public:
  Tdmpc(const Settings& settings, Index observation_size, Index action_size, std::uint64_t seed);

  void SetThreads(std::uint32_t threads) noexcept override { learner_.SetThreads(threads); }
  Learner<float>& learner() { return learner_; }

 private:
  ~Tdmpc() override = default;

  void Step(In<float> states, In<float> actions, In<float>, Mat<float> next, Mat<float> rewards,
            double* discounts) override {
    learner_.agent().Imagine(states, actions, &memory_, next, rewards, discounts);
  }
  void Values(In<float> states, Mat<float> values) override {
    learner_.agent().Values(states, &memory_, values);
  }
  void Act(In<float> states, Index each, In<float> noise, Mat<float> actions) override {
    learner_.agent().Act(states, each, noise, &memory_, actions);
  }
  void Believe(In<float>, In<float>, const double* observations, In<float>,
               Mat<float> next) override {
    const Mat<float> standardised = observations_.Shape(learner_.agent().o, next.cols);
    learner_.StandardiseNow(observations, standardised);
    learner_.agent().Encode(standardised, &memory_, next);
  }
  void Follow(In<float> states, In<float> actions, In<float>, Mat<float> rewards, double* discounts,
              Mat<float> values) override {
    followed_.Forward(learner_.agent(), states, actions, rewards, discounts, values);
  }
  void FollowBackward(In<float> d_rewards, In<float> d_discounts, In<float> d_values,
                      Mat<float> d_actions) override {
    followed_.Backward(learner_.agent(), d_rewards, d_discounts, d_values, d_actions);
  }
  Status Update(const TrainRequest& request, double* metrics) override;
  Status SaveTo(ByteSink* sink) const override { return learner_.Save(sink); }
  Status LoadFrom(ByteSource* source) override { return learner_.Load(source); }
  Status ExportTo(TensorSink* sink) const override { return learner_.Export(sink); }

  Learner<float> learner_;
  Memory<float> memory_;  // what planners ask for
  Followed<float> followed_;
  Buffer<float> observations_;
};

// The component's factory.
Status CreateTdmpc(const ModelContext& context, Model** result) noexcept;

}  // namespace dreamsearch::tdmpc
