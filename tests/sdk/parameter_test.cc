#include "dreamsearch/parameter.h"

#include <gtest/gtest.h>

#include "dreamsearch/environment.h"
#include "dreamsearch/plugin.h"

namespace dreamsearch {
namespace {

TEST(ParameterSpec, PresetsAreKeptInOrder) {
  constexpr ParameterSpec spec =
      IntParameter("starts", 256, 1, 10000, "", "imagination starts").Preset("paper", 2500);
  static_assert(spec.preset_count == 1);
  EXPECT_STREQ(spec.presets[0].preset, "paper");
  EXPECT_EQ(spec.presets[0].number, 2500);
}

TEST(ParameterSpec, ZeroAndFalseAreNumbersNotMissingChoices) {
  constexpr ParameterSpec zero = IntParameter("starts", 256, 0, 10000, "", "").Preset("paper", 0);
  static_assert(zero.presets[0].number == 0 && zero.presets[0].choice == nullptr);
  constexpr ParameterSpec bare = BoolParameter("norm", true, "").Preset("paper", false);
  static_assert(bare.presets[0].number == 0 && bare.presets[0].choice == nullptr);
  constexpr ParameterSpec chosen =
      ChoiceParameter("precision", "float", "float,bfloat16", "").Preset("paper", "bfloat16");
  EXPECT_STREQ(chosen.presets[0].choice, "bfloat16");
}

TEST(Parameters, FindsValuesByName) {
  constexpr ParameterValue kValues[] = {{"depth", 10, nullptr}, {"noise", 0, "mode"}};
  const Parameters parameters{ViewOf(kValues)};
  EXPECT_EQ(parameters.GetInt("depth"), 10);
  EXPECT_TRUE(parameters.IsChoice("noise", "mode"));
  EXPECT_EQ(parameters.Find("absent"), nullptr);
}

TEST(ToEnvironmentBounds, MeetsTheEndsExactlyAndClips) {
  constexpr double kLow[] = {-1, -0.8, 0.1}, kHigh[] = {1.1, 0.8, 0.7};
  EnvironmentSpec spec;
  spec.action_size = 3;
  spec.action_low = ViewOf(kLow);
  spec.action_high = ViewOf(kHigh);
  double action[] = {1, -1, 0}, bounded[3];
  ToEnvironmentBounds(spec, View<double>{action, 3}, {bounded, 3});
  EXPECT_EQ(bounded[0], 1.1);
  EXPECT_EQ(bounded[1], -0.8);
  EXPECT_DOUBLE_EQ(bounded[2], 0.4);
  action[0] = 7;
  ToEnvironmentBounds(spec, View<double>{action, 3}, {bounded, 3});
  EXPECT_EQ(bounded[0], 1.1);
}

}  // namespace
}  // namespace dreamsearch
