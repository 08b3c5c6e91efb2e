// The lambda-return and the value convention, against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "plugins/model_dreamer/behaviour.h"
#include "plugins/model_dreamer/learner.h"
#include "tests/plugins/networks/batches.h"

namespace dreamsearch::dreamer {
namespace {

// Three transitions worked by hand: rewards 1, 2, 3, discounts 0.5, 0.8, 0.5,
// values 10 (unused), 4, 6, 8, lambda 0.5.
//   V_2 = 3 + 0.5 * 8                          = 7
//   V_1 = 2 + 0.8 * (0.5 * 6 + 0.5 * 7)        = 7.2
//   V_0 = 1 + 0.5 * (0.5 * 4 + 0.5 * 7.2)      = 3.8
TEST(LambdaReturn, EqualsTheHandComputedCase) {
  const double rewards[] = {1, 2, 3};
  const double discounts[] = {0.5, 0.8, 0.5};
  const double values[] = {10, 4, 6, 8};
  double returns[3];
  LambdaReturns(Index{3}, Index{1}, 0.5, rewards, discounts, values, returns);
  EXPECT_DOUBLE_EQ(returns[2], 7);
  EXPECT_DOUBLE_EQ(returns[1], 7.2);
  EXPECT_DOUBLE_EQ(returns[0], 3.8);
}

TEST(LambdaReturn, WithLambdaOneIsTheDiscountedSumOfRewards) {
  const double rewards[] = {1, 1, 1, 1};
  const double discounts[] = {0.9, 0.9, 0.9, 0.9};
  const double values[] = {0, 0, 0, 0, 100};
  double returns[4];
  LambdaReturns(Index{4}, Index{1}, 1.0, rewards, discounts, values, returns);
  EXPECT_NEAR(returns[0], 1 + 0.9 + 0.81 + 0.729 + 0.6561 * 100, 1e-12);
}

// The value convention on a process with known values: states 0 -> 1 -> 2 -> 0 ...,
// reward r(s) for arriving at s, and v(s) = the discounted rewards *after* s. The
// fixed point of v <- V_0 under any lambda is that v; a convention that counted
// r(s) into v(s) has another one.
TEST(ValueConvention, LeavesOutTheRewardForArriving) {
  const double reward[] = {5, 1, -2};
  const double gamma = 0.8;
  const double cycle = 1 - gamma * gamma * gamma;
  const double expected[] = {
      (reward[1] + gamma * reward[2] + gamma * gamma * reward[0]) / cycle,
      (reward[2] + gamma * reward[0] + gamma * gamma * reward[1]) / cycle,
      (reward[0] + gamma * reward[1] + gamma * gamma * reward[2]) / cycle,
  };
  for (const double lambda : {0.0, 0.5, 0.95, 1.0}) {
    std::vector<double> v(3, 0.0);
    for (int sweep = 0; sweep < 400; ++sweep) {
      // Three dreams of three transitions, one from each state, tau-major.
      constexpr Index kHorizon = 3, kDreams = 3;
      double rewards[9], discounts[9], values[12], returns[9];
      for (Index tau = 0; tau <= kHorizon; ++tau) {
        for (Index s = 0; s < kDreams; ++s) {
          const auto state = static_cast<std::size_t>((s + tau) % 3);
          values[tau * 3 + s] = v[state];
          if (tau > 0) rewards[(tau - 1) * 3 + s] = reward[state];
          if (tau > 0) discounts[(tau - 1) * 3 + s] = gamma;
        }
      }
      LambdaReturns(kHorizon, kDreams, lambda, rewards, discounts, values, returns);
      for (std::size_t s = 0; s < 3; ++s) v[s] = returns[s];
    }
    for (std::size_t s = 0; s < 3; ++s) {
      EXPECT_NEAR(v[s], expected[s], 1e-9) << "lambda " << lambda << " state " << s;
    }
  }
}

// The same through the whole learner: every decision earns 1, so v must come to
// 1 / (1 - gamma) = 2; one reward too few or too many gives 1 or 3.
TEST(ValueConvention, LearnerFindsTheValueOfAConstantReward) {
  Settings settings = PresetSettings("fast");
  settings.deterministic = settings.hidden = 16;
  settings.stochastic = 4;
  settings.horizon = 5;
  settings.discount = 0.5;
  settings.value_scale = 2;
  settings.imagination_starts = 32;
  settings.model_learning_rate = settings.value_learning_rate = 3e-3;
  Learner<float> learner(settings, 2, 1, 1);
  OwnedBatch batch = RandomBatch(8, 8, 2, 1, 3);
  for (float& r : batch.rewards) r = 1;
  UpdateLosses losses;
  for (std::uint64_t update = 0; update < 600; ++update) {
    const SequenceBatch view = batch.view();
    ASSERT_TRUE(learner.Update({&view, update, update, 0}, &losses).ok());
  }
  EXPECT_NEAR(losses.dream.value_mean, 2, 0.05);
  EXPECT_NEAR(losses.dream.imagined_return, 2, 0.05);
}

}  // namespace
}  // namespace dreamsearch::dreamer
