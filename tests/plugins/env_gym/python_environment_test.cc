// Environments in a Python process behave as the SDK's environments do.
#include "plugins/env_gym/python_environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "tests/plugins/owned.h"

namespace dreamsearch::gym {
namespace {

using testing::HasSubstr;
using Numbers = std::vector<double>;

constexpr const char* kPython = "/usr/bin/python3";  // the one that Debian's NumPy belongs to

using OwnedEnvironment = Owned<Environment>;

PythonEnvironmentSettings World(const std::string& name, const std::string& arguments = "{}") {
  PythonEnvironmentSettings settings;
  settings.kind = "gym";
  settings.interpreter = kPython;
  settings.module = std::string(DREAMSEARCH_SOURCE_DIR) + "/tests/plugins/env_gym/worlds.py";
  settings.id = name;
  settings.arguments = arguments;
  return settings;
}

OwnedEnvironment Make(const PythonEnvironmentSettings& settings) {
  return OwnedEnvironment(new PythonEnvironment(settings));
}

std::string Refusal(const PythonEnvironmentSettings& settings) {
  try {
    Make(settings);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "not refused";
}

Numbers Reset(Environment& environment, std::uint32_t seed) {
  Numbers observation(environment.spec().observation_size);
  const Status status = environment.Reset(seed, {observation.data(), observation.size()});
  EXPECT_TRUE(status.ok()) << status.message;
  return observation;
}

struct Step {
  Status status;
  struct {
    double reward;
    double discount;
    bool last;
  } result = {0, 1, false};
  Numbers observation;
};

Step Take(Environment& environment, Numbers action) {
  Step step;
  step.observation.resize(environment.spec().observation_size);
  StepResult given;
  step.status = environment.Step({action.data(), action.size()},
                                 {step.observation.data(), step.observation.size()}, &given);
  step.result = {given.reward, given.discount, given.last};
  return step;
}

Numbers ActionOf(int i) { return {std::sin(i), 1 + std::cos(i)}; }

class PythonEnvironmentTest : public testing::Test {
 protected:
  void SetUp() override {
    ::signal(SIGPIPE, SIG_IGN);  // as the host's processes do
    if (std::system((std::string(kPython) + " -c 'import numpy' 2>/dev/null").c_str()) != 0) {
      GTEST_SKIP() << kPython << " has no NumPy";
    }
  }
};

TEST_F(PythonEnvironmentTest, HasTheSpacesOfTheEnvironment) {
  const OwnedEnvironment walk = Make(World("Walk"));
  const EnvironmentSpec& spec = walk->spec();
  EXPECT_EQ(spec.observation_size, 2u);
  EXPECT_EQ(Numbers(spec.action_low.begin(), spec.action_low.end()), (Numbers{-1, -1}));
  EXPECT_EQ(Numbers(spec.action_high.begin(), spec.action_high.end()), (Numbers{1, 3}));
  EXPECT_EQ(spec.episode_steps, 1000u);  // it has no limit of its own
  EXPECT_EQ(spec.return_low, spec.return_high);
  EXPECT_GT(spec.control_seconds, 0);  // the host wants one
}

TEST_F(PythonEnvironmentTest, SaysOnceThatItAssumedATimeLimit) {
  const OwnedEnvironment walk = Make(World("Walk"));
  ASSERT_NE(walk->spec().notice, nullptr);
  EXPECT_THAT(walk->spec().notice, HasSubstr("1000 environment steps (env.episode_steps)"));
  PythonEnvironmentSettings limited = World("Walk");
  limited.episode_steps = 7;
  EXPECT_EQ(Make(limited)->spec().notice, nullptr);
}

TEST_F(PythonEnvironmentTest, NamesInterpreterPackagesAndTheModulesFiles) {
  const OwnedEnvironment walk = Make(World("Walk"));
  std::map<std::string, std::string> found;
  for (const Ingredient& ingredient : walk->spec().ingredients) {
    found[ingredient.name] = ingredient.value;
  }
  EXPECT_THAT(found["python"], testing::StartsWith("CPython 3."));
  EXPECT_THAT(found["numpy"], testing::MatchesRegex("[0-9]+\\.[0-9.]+.*"));
  EXPECT_THAT(found["worlds.py"], testing::MatchesRegex("[0-9a-f]{64}"));
  EXPECT_EQ(found.count("pip"), 0u);  // installed, but not imported
}

TEST_F(PythonEnvironmentTest, LaysADictionaryOutInTheOrderOfItsSpace) {
  const OwnedEnvironment named = Make(World("Named"));
  const EnvironmentSpec& spec = named->spec();
  ASSERT_EQ(spec.observation.size, 3u);
  EXPECT_STREQ(spec.observation[0].name, "picture");
  EXPECT_STREQ(spec.observation[2].name, "kind");
  EXPECT_EQ(Reset(*named, 0), (Numbers{0, 1, 2, 3, 4, 5, 0.5, 0, 1, 0}));
}

TEST_F(PythonEnvironmentTest, EqualSeedsGiveEqualEpisodes) {
  const OwnedEnvironment one = Make(World("Walk")), other = Make(World("Walk"));
  Reset(*other, 4);
  Take(*other, {0.5, 0.5});
  EXPECT_EQ(Reset(*one, 3), Reset(*other, 3));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(Take(*one, ActionOf(i)).observation, Take(*other, ActionOf(i)).observation);
  }
  EXPECT_NE(Reset(*one, 3), Reset(*one, 5));
}

TEST_F(PythonEnvironmentTest, TellsATerminalStateFromATimeLimit) {
  const OwnedEnvironment edge = Make(World("Walk", R"({"edge": 2.5})"));
  Reset(*edge, 1);
  Step step;
  for (int i = 0; i < 10 && !step.result.last; ++i) step = Take(*edge, {0, 1});
  EXPECT_TRUE(step.result.last);
  EXPECT_EQ(step.result.discount, 0);
  EXPECT_EQ(step.result.reward, 1);  // an int in Python
  EXPECT_EQ(Take(*edge, {0, 1}).status.code, StatusCode::kFailedPrecondition);

  const OwnedEnvironment truncated = Make(World("Walk", R"({"stop": 3})"));
  Reset(*truncated, 1);
  for (int i = 0; i < 3; ++i) step = Take(*truncated, {0, 0});
  EXPECT_TRUE(step.result.last);
  EXPECT_EQ(step.result.discount, 1);

  PythonEnvironmentSettings limited = World("Walk");
  limited.episode_steps = 2;
  const OwnedEnvironment ours = Make(limited);
  Reset(*ours, 1);
  EXPECT_FALSE(Take(*ours, {0, 0}).result.last);
  step = Take(*ours, {0, 0});
  EXPECT_TRUE(step.result.last);
  EXPECT_EQ(step.result.discount, 1);
}

void ExpectTheSameFromASavedState(const char* name) {
  const OwnedEnvironment played = Make(World(name)), other = Make(World(name));
  Reset(*played, 7);
  for (int i = 0; i < 5; ++i) Take(*played, ActionOf(i));
  auto* saving = ExtensionOf<StateSaving>(played.get());
  std::vector<std::byte> state(saving->state_bytes());
  ASSERT_TRUE(saving->SaveState({state.data(), state.size()}).ok());
  std::vector<Numbers> expected;
  for (int i = 5; i < 9; ++i) expected.push_back(Take(*played, ActionOf(i)).observation);
  for (Environment* environment : {played.get(), other.get(), other.get()}) {
    const Status status =
        ExtensionOf<StateSaving>(environment)->RestoreState({state.data(), state.size()});
    ASSERT_TRUE(status.ok()) << status.message;
    for (int i = 5; i < 9; ++i) {
      EXPECT_EQ(Take(*environment, ActionOf(i)).observation,
                expected[static_cast<std::size_t>(i - 5)]);
    }
  }
  state[0] ^= std::byte{1};
  EXPECT_EQ(ExtensionOf<StateSaving>(other.get())->RestoreState({state.data(), state.size()}).code,
            StatusCode::kDataLoss);
}

TEST_F(PythonEnvironmentTest, GoesToASavedStateByPlayingItsActionsAgain) {
  ExpectTheSameFromASavedState("Walk");
}

TEST_F(PythonEnvironmentTest, GoesToASavedStateByTheEnvironmentsOwnMeans) {
  const OwnedEnvironment walk = Make(World("SavedWalk"));
  EXPECT_LT(ExtensionOf<StateSaving>(walk.get())->state_bytes(), 100u);
  ExpectTheSameFromASavedState("SavedWalk");
}

TEST_F(PythonEnvironmentTest, BoundsAreNeededWhereTheEnvironmentHasNone) {
  PythonEnvironmentSettings settings = World("Free");
  EXPECT_THAT(Refusal(settings), HasSubstr("set env.action_low and env.action_high"));
  settings.action_low = -5;
  settings.action_high = 5;
  const OwnedEnvironment free = Make(settings);
  EXPECT_EQ(free->spec().action_high[0], 5);
  EXPECT_EQ(free->spec().action_high[1], 1);
}

TEST_F(PythonEnvironmentTest, RefusesWithASentenceOfItsOwn) {
  EXPECT_THAT(Refusal(World("Buttons")), HasSubstr("discrete ones are not supported"));
  EXPECT_THAT(Refusal(World("Nobody")), HasSubstr("has no class 'Nobody'"));
  EXPECT_THAT(Refusal(World("Needy")), HasSubstr("a_package_that_nobody_has"));
  EXPECT_THAT(Refusal(World("Outdated")),
              HasSubstr("cannot import what 'Outdated' needs: AttributeError: module 'numpy' has "
                        "no attribute 'a_type_of_1998'"));
  EXPECT_THAT(Refusal(World("Walk", "[1]")), HasSubstr("expected a JSON object"));
  EXPECT_THAT(Refusal(World("Walk", R"({"size": 1})")), HasSubstr("unexpected keyword argument"));
  PythonEnvironmentSettings settings = World("Walk");
  settings.interpreter = "/nowhere/python3";
  EXPECT_THAT(Refusal(settings), HasSubstr("cannot start the interpreter '/nowhere/python3'"));
  settings.interpreter = "/bin/true";
  EXPECT_THAT(Refusal(settings), HasSubstr("/bin/true ended"));
}

TEST_F(PythonEnvironmentTest, AFunctionOfTheModuleMakesAnEnvironmentToo) {
  const OwnedEnvironment brief = Make(World("brief"));
  Reset(*brief, 0);
  Take(*brief, {0, 0});
  Take(*brief, {0, 0});
  EXPECT_TRUE(Take(*brief, {0, 0}).result.last);
}

TEST_F(PythonEnvironmentTest, CallsNothingOfAModuleThatMakesNoEnvironment) {
  const std::filesystem::path made = std::filesystem::path(testing::TempDir()) / "called";
  std::filesystem::remove(made);
  const std::string arguments = R"({"args": ["touch", ")" + made.string() + R"("]})";
  for (const char* module : {"", "subprocess"}) {
    PythonEnvironmentSettings settings = World("Popen", arguments);
    if (*module != '\0') settings.module = module;
    EXPECT_THAT(Refusal(settings), HasSubstr("expected a class with the methods reset and step"));
  }
  EXPECT_THAT(Refusal(World("run", R"({"popenargs": []})")), HasSubstr("makes no environment"));
  EXPECT_FALSE(std::filesystem::exists(made));
}

TEST_F(PythonEnvironmentTest, AnIdImportsNoModule) {
  PythonEnvironmentSettings settings = World("worlds:Walk-v0");
  settings.module.clear();
  EXPECT_THAT(Refusal(settings), HasSubstr("id=Walk-v0 and module=worlds"));
}

TEST_F(PythonEnvironmentTest, NoModuleIsTakenFromTheCurrentFolder) {
  namespace fs = std::filesystem;
  const fs::path before = fs::current_path();
  const fs::path folder = fs::path(testing::TempDir()) / "current_folder";
  fs::create_directories(folder);
  for (const char* name : {"contextlib.py", "numpy.py", "near.py"}) {
    std::ofstream(folder / name) << "open('taken', 'w')\n";
  }
  fs::current_path(folder);
  EXPECT_EQ(Make(World("Walk"))->spec().observation_size, 2u);
  PythonEnvironmentSettings settings = World("Walk");
  settings.module = "near";
  EXPECT_THAT(Refusal(settings), HasSubstr("a file is named with its ending: module=near.py"));
  EXPECT_FALSE(fs::exists("taken"));
  fs::current_path(before);
  fs::remove_all(folder);
}

TEST_F(PythonEnvironmentTest, PassesOnWhatTheEnvironmentRaises) {
  const OwnedEnvironment broken = Make(World("Broken"));
  Reset(*broken, 0);
  const Step step = Take(*broken, {0, 0});
  EXPECT_EQ(step.status.code, StatusCode::kInternal);
  EXPECT_THAT(step.status.message, HasSubstr("Broken: step: ValueError: the door is locked"));
  Reset(*broken, 0);  // the process lives on

  const OwnedEnvironment old = Make(World("Old"));
  Reset(*old, 0);
  EXPECT_THAT(Take(*old, {0, 0}).status.message, HasSubstr("not the older one of gym"));

  const OwnedEnvironment crash = Make(World("Crash"));
  Reset(*crash, 0);
  EXPECT_THAT(Take(*crash, {0, 0}).status.message, HasSubstr("by signal Segmentation fault"));
}

TEST_F(PythonEnvironmentTest, APictureIsOfTheStateAndLeavesItAsItIs) {
  const OwnedEnvironment drawn = Make(World("DrawnWalk")), alone = Make(World("DrawnWalk"));
  Reset(*drawn, 5);
  Reset(*alone, 5);
  for (int i = 0; i < 6; ++i) {
    const Numbers at = Take(*drawn, ActionOf(i)).observation;
    EXPECT_EQ(at, Take(*alone, ActionOf(i)).observation) << i;
    if (i < 2) continue;  // the first picture comes in the middle of the episode
    std::vector<std::uint8_t> rgb(40 * 20 * 3);
    const Status status =
        ExtensionOf<Rendering>(drawn.get())->Render({40, 20, 0}, {rgb.data(), rgb.size()});
    ASSERT_TRUE(status.ok()) << status.message;
    EXPECT_EQ(rgb[0], static_cast<int>(std::clamp(100 + 20 * at[0], 0.0, 255.0)));
    EXPECT_EQ(rgb[1], static_cast<int>(std::clamp(100 + 20 * at[1], 0.0, 255.0)));
    EXPECT_EQ(rgb[19 * 40 * 3], 0);
  }
}

TEST_F(PythonEnvironmentTest, WhatDrawsNoPictureSaysWhy) {
  const OwnedEnvironment environment = Make(World("Walk"));
  Reset(*environment, 0);
  std::vector<std::uint8_t> rgb(8 * 8 * 3);
  const Status status =
      ExtensionOf<Rendering>(environment.get())->Render({8, 8, 0}, {rgb.data(), rgb.size()});
  EXPECT_EQ(status.code, StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message, HasSubstr("cannot be made with render_mode='rgb_array'"));
}

TEST_F(PythonEnvironmentTest, ANumberThatIsNotFiniteIsADivergence) {
  const OwnedEnvironment environment = Make(World("NotANumber"));
  Reset(*environment, 0);
  const Step step = Take(*environment, {0, 0});
  EXPECT_EQ(step.status.code, StatusCode::kDiverged);
  EXPECT_THAT(step.status.message, HasSubstr("step 1: observation 1 is nan"));
}

TEST_F(PythonEnvironmentTest, AnActionThatIsNotANumberIsRefusedAndChangesNothing) {
  const OwnedEnvironment one = Make(World("Walk")), other = Make(World("Walk"));
  Reset(*one, 1);
  Reset(*other, 1);
  EXPECT_EQ(Take(*one, {std::nan(""), 0}).status.code, StatusCode::kInvalidArgument);
  EXPECT_EQ(Take(*one, {0.5, 0.5}).observation, Take(*other, {0.5, 0.5}).observation);
}

}  // namespace
}  // namespace dreamsearch::gym
