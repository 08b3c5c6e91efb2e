#include "dreamsearch/parameter.h"

#include <gtest/gtest.h>

#include "dreamsearch/environment.h"
#include "dreamsearch/plugin.h"
#include "dreamsearch/settings.h"

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
  EXPECT_EQ(parameters.Find("depth")->number, 10);
  EXPECT_STREQ(parameters.Find("noise")->choice, "mode");
  EXPECT_EQ(parameters.Find("absent"), nullptr);
}

struct Walk {
  enum class Gait { kSlow, kFast, kMad };
  std::uint64_t steps;
  double speed;
  double count;  // an integer parameter
  bool upright;
  bool backwards;  // the second choice of two
  Gait gait;
  std::string surface;
};
struct LongWalk : Walk {
  std::int32_t rests;
};
constexpr auto kWalk = BindSettings<LongWalk>(
    Bind<&Walk::steps>(IntParameter("steps", 10, 0, 1000, "", "")),
    Bind<&Walk::speed>(RealParameter("speed", 0.5, 0, 1, "", "")),
    Bind<&Walk::count>(IntParameter("count", 3, 0, 9, "", "")),
    Bind<&Walk::upright>(BoolParameter("upright", true, "")),
    Bind<&Walk::backwards>(ChoiceParameter("direction", "forwards", "forwards,backwards", "")),
    Bind<&Walk::gait>(ChoiceParameter("gait", "slow", "slow,fast,mad", "")),
    Bind<&Walk::surface>(TextParameter("surface", "", "")),
    Bind<&LongWalk::rests>(IntParameter("rests", -1, -5, 5, "", "")));

TEST(BindSettings, DeclaresItsParametersInOrderAndReadsThemIntoTheMembers) {
  ASSERT_EQ(kWalk.declared().size, 8u);
  EXPECT_STREQ(kWalk.declared()[4].name, "direction");
  const ParameterValue values[] = {{"rests", -2, nullptr},        {"gait", 0, "mad"},
                                   {"steps", 7, nullptr},         {"speed", 0.25, nullptr},
                                   {"count", 9, nullptr},         {"upright", 1, nullptr},
                                   {"direction", 0, "backwards"}, {"surface", 0, "sand"}};
  const LongWalk walk = kWalk.Read({ViewOf(values)});
  EXPECT_EQ(walk.steps, 7u);
  EXPECT_EQ(walk.speed, 0.25);
  EXPECT_EQ(walk.count, 9);
  EXPECT_TRUE(walk.upright);
  EXPECT_TRUE(walk.backwards);
  EXPECT_EQ(walk.gait, Walk::Gait::kMad);
  EXPECT_EQ(walk.surface, "sand");
  EXPECT_EQ(walk.rests, -2);
}

TEST(BindSettings, RefusesValuesOfWhichOneIsMissing) {
  const ParameterValue values[] = {{"steps", 7, nullptr}};
  EXPECT_THROW(kWalk.Read({ViewOf(values)}), std::invalid_argument);
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
