// The presets: `paper` has exactly the numbers of the papers.
#include "plugins/model_dreamer/settings.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>
#include <vector>

namespace dreamsearch::dreamer {
namespace {

TEST(Settings, PaperPresetHasThePapersNumbers) {
  const Settings s = PresetSettings("paper");
  EXPECT_EQ(s.deterministic, 200);
  EXPECT_EQ(s.stochastic, 30);
  EXPECT_EQ(s.hidden, 200);
  EXPECT_EQ(s.encoder_layers, 3);
  EXPECT_EQ(s.decoder_layers, 2);
  EXPECT_EQ(s.reward_layers, 2);
  EXPECT_EQ(s.continuation_layers, 3);
  EXPECT_EQ(s.actor_layers, 4);
  EXPECT_EQ(s.value_layers, 3);
  EXPECT_EQ(s.critics, 1);
  EXPECT_FALSE(s.layer_norm);
  EXPECT_FALSE(s.normalise_observations);
  EXPECT_EQ(s.observation_weight, 1);
  EXPECT_EQ(s.reward_weight, 1);
  EXPECT_EQ(s.kl_scale, 1);
  EXPECT_EQ(s.kl_prior_factor, 1);
  EXPECT_EQ(s.kl_posterior_factor, 1);
  EXPECT_EQ(s.free_nats, 3);
  EXPECT_FALSE(s.free_nats_per_step);
  EXPECT_EQ(s.min_std, 0.1);
  EXPECT_FALSE(s.continuation);
  EXPECT_EQ(s.continuation_scale, 10);
  EXPECT_FALSE(s.zero_heads);
  EXPECT_EQ(s.horizon, 15);
  EXPECT_EQ(s.imagination_starts, 0);
  EXPECT_EQ(s.start_skip, 0);
  EXPECT_EQ(s.discount, 0.99);
  EXPECT_EQ(s.lambda, 0.95);
  EXPECT_EQ(s.actor_mean_limit, 5);
  EXPECT_EQ(s.actor_initial_std, 5);
  EXPECT_EQ(s.actor_min_std, 1e-4);
  EXPECT_EQ(s.entropy_scale, 0);
  EXPECT_FALSE(s.percentile_return_scale);
  EXPECT_EQ(s.value_scale, 1);
  EXPECT_EQ(s.slow_critic_weight, 0);
  EXPECT_EQ(s.model_learning_rate, 6e-4);
  EXPECT_EQ(s.actor_learning_rate, 8e-5);
  EXPECT_EQ(s.value_learning_rate, 8e-5);
  EXPECT_EQ(s.adam_beta1, 0.9);
  EXPECT_EQ(s.adam_beta2, 0.999);
  EXPECT_EQ(s.adam_epsilon, 1e-7);
  EXPECT_EQ(s.gradient_clip, 100);
  EXPECT_EQ(s.actor_average, 1);
  EXPECT_FALSE(s.bfloat16);
  EXPECT_FALSE(s.acting_latent_mean);
  EXPECT_TRUE(s.imagined_latent_mean);
}

// Another default is a decision: the published figures are of these.
TEST(Settings, FastPresetHasTheNumbersItWasMeasuredWith) {
  const Settings s = PresetSettings("fast");
  EXPECT_EQ(s.deterministic, 128);
  EXPECT_EQ(s.stochastic, 32);
  EXPECT_EQ(s.hidden, 128);
  EXPECT_FALSE(s.layer_norm);
  EXPECT_TRUE(s.normalise_observations);
  EXPECT_EQ(s.observation_weight, 5);
  EXPECT_EQ(s.reward_weight, 50);
  EXPECT_EQ(s.kl_posterior_factor, 0.1);
  EXPECT_EQ(s.free_nats, 1);
  EXPECT_TRUE(s.free_nats_per_step);
  EXPECT_TRUE(s.zero_heads);
  EXPECT_EQ(s.actor_layers, 2);
  EXPECT_EQ(s.value_layers, 2);
  EXPECT_EQ(s.horizon, 8);
  EXPECT_EQ(s.imagination_starts, 64);
  EXPECT_EQ(s.start_skip, 4);
  EXPECT_EQ(s.actor_initial_std, 1);
  EXPECT_EQ(s.actor_min_std, 0.1);
  EXPECT_EQ(s.entropy_scale, 3e-3);
  EXPECT_TRUE(s.percentile_return_scale);
  EXPECT_EQ(s.value_scale, 100);
  EXPECT_EQ(s.slow_critic_weight, 1);
  EXPECT_EQ(s.model_learning_rate, 6e-4);
  EXPECT_EQ(s.actor_learning_rate, 3e-4);
  EXPECT_EQ(s.value_learning_rate, 3e-4);
  EXPECT_TRUE(s.bfloat16);
  EXPECT_FALSE(s.bfloat16_planning);
}

// Another legal value of any declared parameter makes other settings: none is misspelt or
// forgotten where they are read.
TEST(Settings, EveryParameterIsRead) {
  std::vector<ParameterValue> values;
  for (const ParameterSpec& spec : DeclaredParameters()) values.push_back(ValueUnder(spec, "fast"));
  const auto settings = [&] { return SettingsFrom({{values.data(), values.size()}}, true); };
  const Settings before = settings();
  EXPECT_EQ(before, settings());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const ParameterSpec& spec = DeclaredParameters()[i];
    const ParameterValue kept = values[i];
    if (spec.type == ParameterType::kChoice) {
      const std::string choices = spec.choices;
      const std::string first = choices.substr(0, choices.find(','));
      const std::string last = choices.substr(choices.rfind(',') + 1);
      values[i].choice = kept.choice == first ? last.c_str() : first.c_str();
      EXPECT_NE(before, settings()) << spec.name << " changes nothing";
    } else {
      values[i].number = kept.number != spec.min ? spec.min : spec.max;
      EXPECT_NE(before, settings()) << spec.name << " changes nothing";
    }
    values[i] = kept;
  }
}

TEST(Settings, DeclarationsAreCompleteAndInRange) {
  std::set<std::string> names;
  for (const ParameterSpec& spec : DeclaredParameters()) {
    EXPECT_TRUE(names.insert(spec.name).second) << spec.name << " twice";
    EXPECT_GT(std::strlen(spec.help), 10u) << spec.name;
    EXPECT_NE(spec.unit, nullptr) << spec.name;
    if (spec.type == ParameterType::kChoice) {
      const std::string choices = "," + std::string(spec.choices) + ",";
      const auto declared = [&](const char* choice) {
        return choice != nullptr && choices.find("," + std::string(choice) + ",") != choices.npos;
      };
      EXPECT_TRUE(declared(spec.default_choice)) << spec.name;
      for (std::uint32_t i = 0; i < spec.preset_count; ++i) {
        EXPECT_TRUE(declared(spec.presets[i].choice)) << spec.name;
      }
      continue;
    }
    EXPECT_GE(spec.default_number, spec.min) << spec.name;
    EXPECT_LE(spec.default_number, spec.max) << spec.name;
    for (std::uint32_t i = 0; i < spec.preset_count; ++i) {
      EXPECT_GE(spec.presets[i].number, spec.min) << spec.name;
      EXPECT_LE(spec.presets[i].number, spec.max) << spec.name;
    }
  }
}

}  // namespace
}  // namespace dreamsearch::dreamer
