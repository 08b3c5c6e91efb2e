// The presets: `paper` has exactly the numbers of TD-MPC2's 5M agent.
#include "plugins/model_tdmpc/settings.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>

namespace dreamsearch::tdmpc {
namespace {

TEST(Settings, PaperPresetHasThePapersNumbers) {
  const Settings s = PresetSettings("paper");
  EXPECT_EQ(s.latent, 512);
  EXPECT_EQ(s.encoder_width, 256);
  EXPECT_EQ(s.encoder_layers, 1);
  EXPECT_EQ(s.width, 512);
  EXPECT_EQ(s.layers, 2);
  EXPECT_EQ(s.critics, 5);
  EXPECT_EQ(s.bins.count, 101);
  EXPECT_EQ(s.bins.low, -10);
  EXPECT_EQ(s.bins.high, 10);
  EXPECT_FALSE(s.normalise_observations);
  EXPECT_EQ(s.rho, 0.5);
  EXPECT_EQ(s.consistency_weight, 20);
  EXPECT_EQ(s.reward_weight, 0.1);
  EXPECT_EQ(s.value_weight, 0.1);
  EXPECT_EQ(s.continuation_weight, 1);
  EXPECT_EQ(s.discount, 0.99);
  EXPECT_FALSE(s.target_of_all);
  EXPECT_EQ(s.target_rate, 0.01);
  EXPECT_EQ(s.min_log_std, -10);
  EXPECT_EQ(s.max_log_std, 2);
  EXPECT_EQ(s.entropy_scale, 1e-4);
  EXPECT_EQ(s.return_scale_rate, 0.01);
  EXPECT_EQ(s.learning_rate, 3e-4);
  EXPECT_EQ(s.encoder_rate_factor, 0.3);
  EXPECT_EQ(s.actor_learning_rate, 3e-4);
  EXPECT_EQ(s.adam_epsilon, 1e-8);
  EXPECT_EQ(s.actor_adam_epsilon, 1e-5);
  EXPECT_EQ(s.gradient_clip, 20);
  EXPECT_FALSE(s.bfloat16);
  EXPECT_FALSE(s.bfloat16_planning);
}

TEST(Settings, FastPresetIsTheSizeThatACoreCanTrain) {
  const Settings s = PresetSettings("fast");
  EXPECT_EQ(s.latent, 128);
  EXPECT_EQ(s.width, 128);
  EXPECT_EQ(s.critics, 2);
  EXPECT_TRUE(s.normalise_observations);
}

TEST(Settings, EveryParameterNamesASource) {
  for (const ParameterSpec& spec : DeclaredParameters()) {
    const std::string help = spec.help;
    EXPECT_TRUE(help.find('[') != std::string::npos && help.find(']') != std::string::npos)
        << spec.name;
  }
}

}  // namespace
}  // namespace dreamsearch::tdmpc
