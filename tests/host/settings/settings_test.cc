// From options to runs.
// Over 400 lines: every rule of resolving is held against the same three components.
#include "host/settings/settings.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "dreamsearch/random.h"
#include "host/settings/run_parameters.h"
#include "results/system/error.h"
#include "results/system/sha256.h"
#include "tests/host/refusal.h"
#include "tests/host/settings/test_catalogue.h"

namespace dreamsearch {
namespace {

Setting File(const std::string& key, const std::string& value) {
  return {key, value, true, "/x.cfg, line 3", {}};
}

RunSpec With(const std::vector<Setting>& settings) {
  RunOptions options = Base();
  options.settings = settings;
  return Resolve(options);
}

void ExpectBad(const std::vector<Setting>& settings, const std::vector<std::string>& parts) {
  const ExitCode code = settings.back().from_file ? ExitCode::kBadInput : ExitCode::kUsage;
  ExpectRefusal([&] { With(settings); }, code, parts);
}

TEST(ResolveMatrix, DefaultIsBelowPresetBelowFileBelowCommandLine) {
  const RunSpec preset = With({});
  EXPECT_EQ(preset.planner.parameters.Number("simulations"), 40);  // fast
  EXPECT_EQ(preset.planner.parameters.Choice("first_play"), "zero");
  EXPECT_EQ(preset.planner.parameters.Number("noise"), 0.3);  // none for fast
  EXPECT_EQ(preset.planner.parameters.Find("noise")->origin, ValueOrigin::kDefault);
  EXPECT_EQ(preset.planner.parameters.Find("simulations")->origin, ValueOrigin::kPreset);
  EXPECT_EQ(preset.model.parameters.Number("learning_rate"), 1e-3);

  const RunSpec file = With({File("planner.simulations", "30")});
  EXPECT_EQ(file.planner.parameters.Number("simulations"), 30);
  EXPECT_EQ(file.planner.parameters.Find("simulations")->origin, ValueOrigin::kFile);

  const RunSpec both =
      With({File("mcts_pw.simulations", "30"), CommandLine("planner.simulations", "20")});
  EXPECT_EQ(both.planner.parameters.Number("simulations"), 20);
  EXPECT_EQ(both.planner.parameters.Find("simulations")->origin, ValueOrigin::kCommandLine);

  RunOptions paper = Base();
  paper.preset = "paper";
  EXPECT_EQ(Resolve(paper).planner.parameters.Number("noise"), 0.25);
  EXPECT_EQ(Resolve(paper).planner.parameters.Number("simulations"), 50);
  EXPECT_EQ(Resolve(paper).steps(), 2000000u);
  EXPECT_EQ(Resolve(Base()).steps(), 100000u);
  EXPECT_EQ(Resolve(Base()).action_repeat(), 2u);
}

TEST(ResolveMatrix, AModelsRunValuesStandAboveThePresetAndBelowFileAndCommandLine) {
  RunOptions options = Base();
  options.models = {"wishing"};
  const RunSpec wished = Resolve(options);
  EXPECT_EQ(wished.run.Integer("batch_size"), 256u);
  EXPECT_EQ(wished.run.Find("batch_size")->origin, ValueOrigin::kModel);
  EXPECT_EQ(wished.run.Integer("sequence_length"), 4u);
  EXPECT_EQ(wished.run.Integer("train_every"), Resolve(Base()).run.Integer("train_every"));
  options.preset = "paper";
  EXPECT_EQ(Resolve(options).run.Integer("batch_size"), 128u);
  EXPECT_EQ(Resolve(options).run.Integer("sequence_length"), 50u);  // the runner's
  EXPECT_EQ(Resolve(options).action_repeat(), 4u);
  options.preset = "fast";
  options.settings = {File("run.batch_size", "32"), CommandLine("run.sequence_length", "9")};
  const RunSpec set = Resolve(options);
  EXPECT_EQ(set.run.Integer("batch_size"), 32u);
  EXPECT_EQ(set.run.Find("batch_size")->origin, ValueOrigin::kFile);
  EXPECT_EQ(set.run.Integer("sequence_length"), 9u);
  // A recorded run keeps what it was resolved to.
  const RunSpec restored = RunSpecFromJson(ToJson(set));
  EXPECT_EQ(CanonicalJson(restored), CanonicalJson(set));
  options.settings.clear();
  EXPECT_EQ(ResolveMatrix(options, TestCatalogue(), &set).at(0).run.Integer("batch_size"), 32u);
}

TEST(ResolveMatrix, ModelsOfOneCommandEachHaveTheirRunValues) {
  RunOptions options = Base();
  options.models = {"wishing", "dreamer"};
  const std::vector<RunSpec> runs = ResolveMatrix(options, TestCatalogue());
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0].run.Integer("batch_size"), 256u);
  EXPECT_EQ(runs[1].run.Integer("batch_size"), 16u);
  EXPECT_EQ(runs[1].run.Find("batch_size")->origin, ValueOrigin::kPreset);
  // What the model asks for is checked with the rest of its runs' values.
  options.preset = "paper";
  options.settings = {CommandLine("run.steps", "1002")};
  ExpectRefusal([&] { ResolveMatrix(options, TestCatalogue()); }, ExitCode::kUsage,
                {"run.action_repeat = 4", "1002"});
}

TEST(ResolveMatrix, AnEnvironmentsRunValuesStandAboveAModelsAndBelowFileAndCommandLine) {
  RunOptions options = Base();
  options.preset = "paper";
  options.models = {"dreamer", "wishing"};  // `wishing` asks for action_repeat 4
  options.environments = {"walker_walk", "bridge:hop"};
  const std::vector<RunSpec> runs = ResolveMatrix(options, TestCatalogue());
  ASSERT_EQ(runs.size(), 4u);
  std::map<std::string, std::uint32_t> repeats;
  for (const RunSpec& run : runs) {
    repeats[run.environment.task() + " " + run.model.name()] = run.action_repeat();
    EXPECT_EQ(run.run.Integer("batch_size"), run.model.name() == "wishing" ? 128u : 50u);
  }
  EXPECT_EQ(repeats, (std::map<std::string, std::uint32_t>{{"walker_walk dreamer", 2},
                                                           {"walker_walk wishing", 4},
                                                           {"bridge:hop dreamer", 1},
                                                           {"bridge:hop wishing", 1}}));
  options.environments = {"bridge:hop"};
  options.models = {"wishing"};
  EXPECT_EQ(Resolve(options).run.Find("action_repeat")->origin, ValueOrigin::kEnvironment);
  options.settings = {File("run.action_repeat", "5")};
  EXPECT_EQ(Resolve(options).action_repeat(), 5u);
  options.settings = {CommandLine("run.action_repeat", "3"), CommandLine("run.steps", "999")};
  EXPECT_EQ(Resolve(options).action_repeat(), 3u);
}

TEST(ResolveMatrix, RefusesAModelThatAsksForWhatTheRunnerDoesNotHave) {
  RunOptions options = Base();
  options.models = {"misspelling"};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kPluginRefused,
                {"model 'misspelling' asks for run.batch_sise = 256", "batch_size"});
  options.models = {"exaggerating"};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kPluginRefused,
                {"run.batch_size = 5000", "an integer from 1 to 4096"});
}

TEST(ResolveMatrix, ANameWinsOverAKindInOneSourceInAnyOrder) {
  for (const bool name_first : {true, false}) {
    std::vector<Setting> settings = {CommandLine("mcts_pw.simulations", "7"),
                                     CommandLine("planner.simulations", "8")};
    if (!name_first) std::swap(settings[0], settings[1]);
    EXPECT_EQ(With(settings).planner.parameters.Number("simulations"), 7);
  }
}

TEST(ResolveMatrix, TakesTheModelThatDeclaresItselfTheDefault) {
  RunOptions options = Base();
  options.models = {};
  EXPECT_EQ(Resolve(options).model.name(), "dreamer");  // `another` learns too
  options.evaluate = true;
  EXPECT_EQ(Resolve(options).model.name(), "oracle");
}

TEST(ResolveMatrix, RunsTheCrossProductWithSeedsOutermost) {
  RunOptions options = Base();
  options.environments = {"walker_walk", "cup_catch"};
  options.planners = {"dreamer", "mcts_pw"};
  options.models = {"dreamer", "oracle"};
  options.seeds = {4, 2};
  const std::vector<RunSpec> runs = ResolveMatrix(options, TestCatalogue());
  ASSERT_EQ(runs.size(), 16u);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    EXPECT_EQ(runs[i].environment.name(), i / 4 % 2 == 0 ? "walker_walk" : "cup_catch");
    EXPECT_EQ(runs[i].planner.name(), i / 2 % 2 == 0 ? "dreamer" : "mcts_pw");
    EXPECT_EQ(runs[i].model.name(), i % 2 == 0 ? "dreamer" : "oracle");
    EXPECT_EQ(runs[i].seed, i < 8 ? 4u : 2u);
    EXPECT_EQ(runs[i].eval_planner.name(), runs[i].planner.name());
  }
}

TEST(ResolveMatrix, AKindsKeyReachesEveryListedPlannerThatDeclaresIt) {
  RunOptions options = Base();
  options.planners = {"dreamer", "mcts_pw", "cem"};
  options.settings = {CommandLine("planner.noise", "0.5"), CommandLine("planner.candidates", "9")};
  const std::vector<RunSpec> runs = ResolveMatrix(options, TestCatalogue());
  EXPECT_EQ(runs[0].planner.parameters.Number("noise"), 0.5);
  EXPECT_EQ(runs[1].planner.parameters.Number("noise"), 0.5);
  EXPECT_EQ(runs[2].planner.parameters.Number("candidates"), 9);
  EXPECT_EQ(runs[2].planner.parameters.Find("noise"), nullptr);
  // The model of the same name keeps its own.
  EXPECT_EQ(runs[0].model.parameters.Number("noise"), 0.1);
}

TEST(ResolveMatrix, ANameOfTwoKindsMustSayWhich) {
  RunOptions options = Base();
  options.planners = {"dreamer"};
  options.settings = {CommandLine("dreamer.noise", "0.5")};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage,
                {"planner/dreamer.noise", "model/dreamer.noise"});
  options.settings = {CommandLine("planner/dreamer.noise", "0.5"),
                      CommandLine("dreamer.starts", "7")};
  const RunSpec run = Resolve(options);
  EXPECT_EQ(run.planner.parameters.Number("noise"), 0.5);
  EXPECT_EQ(run.model.parameters.Number("noise"), 0.1);
  EXPECT_EQ(run.model.parameters.Number("starts"), 7);
}

TEST(ResolveMatrix, AnEvaluationPlannerIsSetByItsNameOnly) {
  RunOptions options = Base();
  options.eval_planner = "cem";
  options.settings = {CommandLine("cem.candidates", "9")};
  const RunSpec run = Resolve(options);
  EXPECT_EQ(run.planner.name(), "mcts_pw");
  EXPECT_EQ(run.eval_planner.name(), "cem");
  EXPECT_EQ(run.eval_planner.parameters.Number("candidates"), 9);
  options.settings = {CommandLine("planner.candidates", "9")};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage, {"no parameter 'candidates'"});
}

TEST(ResolveMatrix, AliasesStandForTheComponent) {
  RunOptions options = Base();
  options.environments = {"ball_in_cup_catch"};
  options.settings = {CommandLine("cup_catch.sparse", "true")};
  EXPECT_EQ(Resolve(options).environment.name(), "cup_catch");
  EXPECT_EQ(Resolve(options).environment.parameters.Number("sparse"), 1);
  options.environments = {"ball_in_cup_catch", "cup_catch"};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage, {"the same component"});
}

TEST(ResolveMatrix, SaysWhatIsKnownOfAWrongName) {
  ExpectBad({CommandLine("planner.simulation", "3")},
            {"no parameter 'simulation' in planner/mcts_pw", "Known: noise, simulations",
             "Did you mean simulations?"});
  ExpectBad({CommandLine("mcst_pw.noise", "3")},
            {"'mcst_pw' is no component of this command", "Did you mean mcts_pw?"});
  ExpectBad({CommandLine("cem.candidates", "3")}, {"'cem' is no component of this command"});
  ExpectBad({CommandLine("run.action_repeats", "3")}, {"Did you mean action_repeat?"});
  ExpectBad({CommandLine("noise", "3")}, {"expected a key such as"});
  ExpectBad({CommandLine("planner.", "3")}, {"expected a key such as"});
  ExpectBad({File("planner.simulation", "3")}, {"/x.cfg, line 3", "Did you mean simulations?"});

  RunOptions options = Base();
  options.planners = {"mcts_wp"};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kNotFound,
                {"no planner 'mcts_wp'", "Known: cem, dreamer, mcts_pw.", "Did you mean mcts_pw?"});
  options = Base();
  options.preset = "quick";
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage, {"no preset 'quick'", "fast, paper"});
}

TEST(ResolveMatrix, SaysRangeTypeAndDefaultOfAWrongValue) {
  ExpectBad({CommandLine("planner.simulations", "0")},
            {"planner.simulations", "an integer from 1 to 1000000 (simulations), default 50",
             "found '0'"});
  ExpectBad({File("planner.simulations", "1000001")}, {"/x.cfg, line 3", "found '1000001'"});
  for (const char* bad : {"", "many", "2.5", "1e-3", "nan", "inf", "50 ", " 50", "0x10", "1e400",
                          "99999999999999999999", "50;", "--"}) {
    ExpectBad({CommandLine("planner.simulations", bad)}, {"an integer from 1 to 1000000"});
  }
  for (const char* bad : {"", "-0.1", "10.5", "nan", "inf", "0,5", "1e400"}) {
    ExpectBad({CommandLine("planner.noise", bad)}, {"a number from 0 to 10, default 0.3"});
  }
  for (const char* bad : {"", "True", "2", "maybe"}) {
    ExpectBad({CommandLine("env.sparse", bad)}, {"true or false, default false"});
  }
  ExpectBad({CommandLine("planner.first_play", "zeros")},
            {"one of parent, zero, default parent", "Did you mean zero?"});
  const std::string enormous(100000, '9');
  try {
    With({CommandLine("planner.noise", enormous)});
    FAIL() << "accepted";
  } catch (const Failure& error) {
    EXPECT_LT(std::string(error.what()).size(), 300u);
  }
}

TEST(ResolveMatrix, ReadsTheWaysPeopleWriteValues) {
  EXPECT_EQ(With({CommandLine("run.steps", "2e6")}).steps(), 2000000u);
  EXPECT_EQ(
      With({CommandLine("model.learning_rate", "3e-4")}).model.parameters.Number("learning_rate"),
      3e-4);
  for (const char* yes : {"true", "1", "on", "yes"}) {
    EXPECT_EQ(With({CommandLine("env.sparse", yes)}).environment.parameters.Number("sparse"), 1);
  }
  EXPECT_FALSE(
      std::signbit(With({CommandLine("planner.noise", "-0")}).planner.parameters.Number("noise")));
}

TEST(ResolveMatrix, RefusesAKeySetTwiceInOneSource) {
  ExpectBad({CommandLine("planner.noise", "1"), CommandLine("planner.noise", "2")}, {"set twice"});
  ExpectBad({CommandLine("mcts_pw.noise", "1"), CommandLine("planner/mcts_pw.noise", "1")},
            {"set twice", "mcts_pw.noise"});
}

TEST(ResolveMatrix, WantsStepsThatDecisionsDivide) {
  ExpectBad({CommandLine("run.steps", "5001")}, {"multiple of run.action_repeat = 2", "5000"});
  ExpectBad({CommandLine("run.steps", "0")}, {"an integer from 1"});
  ExpectBad({CommandLine("run.steps", "-4")}, {"an integer from 1"});
  ExpectBad({File("run.steps", "5001")}, {"multiple of"});
  EXPECT_EQ(With({CommandLine("run.steps", "5001"), CommandLine("run.action_repeat", "3")}).steps(),
            5001u);
}

TEST(ResolveMatrix, RefusesMoreRunsThanAnyoneMeans) {
  RunOptions options = Base();
  options.seeds.resize(100001);
  ExpectRefusal([&] { ResolveMatrix(options, TestCatalogue()); }, ExitCode::kUsage,
                {"at most 100000 runs"});
}

// --- identity and round trip ---------------------------------------------------

TEST(CanonicalJson, IsTheConfigurationWithoutStudySeedAndOrigin) {
  RunOptions options = Base();
  options.settings = {CommandLine("planner.simulations", "40")};  // the preset's value
  options.study = "another";
  options.seeds = {77};
  EXPECT_EQ(CanonicalJson(Resolve(options)), CanonicalJson(With({})));
  EXPECT_EQ(ConfigurationSha256(Resolve(options)), ConfigurationSha256(With({})));
  EXPECT_EQ(ConfigurationSha256(With({})), Sha256Hex(CanonicalJson(With({}))));
}

TEST(CanonicalJson, ChangesWithEverySetting) {
  std::set<std::string> digests = {ConfigurationSha256(With({}))};
  const std::vector<Setting> changes = {CommandLine("planner.simulations", "41"),
                                        CommandLine("planner.first_play", "parent"),
                                        CommandLine("planner.noise", "0.30000000000000004"),
                                        CommandLine("model.starts", "255"),
                                        CommandLine("env.sparse", "true"),
                                        CommandLine("run.steps", "99998"),
                                        CommandLine("run.eval_episodes", "6")};
  for (const Setting& change : changes) {
    EXPECT_TRUE(digests.insert(ConfigurationSha256(With({change}))).second) << change.key;
  }
  RunOptions options = Base();
  options.eval_planner = "cem";
  EXPECT_TRUE(digests.insert(ConfigurationSha256(Resolve(options))).second);
}

// A database from before parameters were there: its runs have the values by which they were made,
// and the configuration of a command that gives those today.
TEST(CanonicalJson, RunParametersThatCameLaterAreNotMissed) {
  const RunSpec today = With({{"run.exploration_hold", "1"}});
  RunSpec recorded = today;
  for (const LaterRunParameter& later : kLaterRunParameters) {
    EXPECT_EQ(CanonicalJson(today).find("\"" + std::string(later.name) + "\""), std::string::npos);
    std::erase_if(recorded.run.values,
                  [&](const ResolvedValue& value) { return value.name == later.name; });
  }
  EXPECT_EQ(CanonicalJson(recorded), CanonicalJson(today));
  AddLaterRunParameters(&recorded.run);
  EXPECT_EQ(recorded.run.values.size(), today.run.values.size());
  for (const LaterRunParameter& later : kLaterRunParameters) {
    EXPECT_EQ(recorded.run.Number(std::string(later.name)), later.before);
  }
  EXPECT_NE(CanonicalJson(With({{"run.exploration_hold", "4"}})), CanonicalJson(today));
}

TEST(CanonicalJson, HasSortedKeysAndTypedValues) {
  const std::string text = CanonicalJson(With({}));
  EXPECT_NE(text.find(R"("planner":{"name":"mcts_pw","parameters":{"first_play":"zero",)"
                      R"("noise":0.3,"simulations":40}})"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find(R"("environment":{"name":"walker_walk","parameters":{"sparse":false}})"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find(R"("steps":100000)"), std::string::npos) << text;
}

TEST(RunSpecFromJson, BringsBackEverything) {
  RunOptions options = Base();
  options.study = "it's; \xf0\x9f\x98\x80 %s ../";
  options.seeds = {9223372036854775807ull};
  options.eval_planner = "cem";
  options.settings = {CommandLine("planner.noise", "0.1"), File("run.steps", "4000")};
  const RunSpec run = Resolve(options);
  const std::string text = ToJson(run).dump();
  const RunSpec back = RunSpecFromJson(nlohmann::json::parse(text));
  EXPECT_EQ(ToJson(back).dump(), text);
  EXPECT_EQ(back.study, options.study);
  EXPECT_EQ(back.seed, 9223372036854775807ull);
  EXPECT_EQ(back.steps(), 4000u);
  EXPECT_EQ(back.eval_planner.name(), "cem");
  EXPECT_EQ(back.planner.info->plugin.sha256, run.planner.info->plugin.sha256);
  EXPECT_EQ(back.planner.info->plugin.path, run.planner.info->plugin.path);
  EXPECT_EQ(back.run.Find("steps")->origin, ValueOrigin::kFile);
  EXPECT_EQ(CanonicalJson(back), CanonicalJson(run));
}

TEST(RunSpecFromJson, KeepsEveryBitOfADouble) {
  RunSpec run = With({});
  constexpr std::uint64_t kSeed = 5;
  Random random(kSeed);
  std::vector<double> values = {
      5e-324, 1.7976931348623157e308, 2.2250738585072014e-308, 0.1, 1.0 / 3, -0.0};
  while (values.size() < 2000) {
    const auto value = std::bit_cast<double>(random.Next());
    if (std::isfinite(value)) values.push_back(value);
  }
  run.planner.parameters.values.resize(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    run.planner.parameters.values[i].number = values[i];
  }
  const RunSpec back = RunSpecFromJson(nlohmann::json::parse(ToJson(run).dump()));
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_EQ(std::bit_cast<std::uint64_t>(back.planner.parameters.values[i].number),
              std::bit_cast<std::uint64_t>(values[i]))
        << "seed " << kSeed << ", value " << values[i];
  }
}

TEST(RunSpecFromJson, RefusesWhatIsNotOne) {
  nlohmann::json json = ToJson(With({}));
  json.erase("planner");
  ExpectRefusal([&] { RunSpecFromJson(json); }, ExitCode::kInternal, {"planner"});
  ExpectRefusal([] { RunSpecFromJson(nlohmann::json(3)); }, ExitCode::kInternal, {"read"});
}

TEST(ParameterStorage, GivesAFactoryItsValues) {
  const RunSpec run = With({CommandLine("planner.first_play", "parent")});
  const ParameterStorage storage(run.planner.parameters);
  const Parameters parameters = storage.view();
  EXPECT_EQ(parameters.values.size, 3u);
  EXPECT_EQ(parameters.Find("noise")->number, 0.3);
  EXPECT_EQ(parameters.Find("simulations")->number, 40);
  EXPECT_STREQ(parameters.Find("first_play")->choice, "parent");
}

TEST(ResolveMatrix, ATextIsTakenAsItIsWritten) {
  RunOptions options = Base();
  options.environments = {"bridge"};
  EXPECT_EQ(Resolve(options).environment.parameters.Choice("id"), "none");
  const std::string text = "{\"a b\": [1, \"=#'\"]}  \xc3\xa9";
  options.settings = {CommandLine("bridge.id", text)};
  const RunSpec run = Resolve(options);
  const ParameterStorage storage(run.environment.parameters);
  EXPECT_EQ(storage.view().Find("id")->choice, text);
  EXPECT_EQ(RunSpecFromJson(ToJson(run)).environment.parameters.Choice("id"), text);
  EXPECT_NE(ConfigurationSha256(run), ConfigurationSha256(With({})));

  options.settings = {CommandLine("env.id", "two\nlines")};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage,
                {"env.id: expected a text of one line, default 'none'"});
}

TEST(ResolveMatrix, AnEnvironmentThatPlaysManyThingsIsATaskForEach) {
  RunOptions options = Base();
  options.environments = {"bridge:Hopper-v5", "walker_walk", "bridge:my.Other:v0"};
  const std::vector<RunSpec> runs = ResolveMatrix(options, TestCatalogue());
  ASSERT_EQ(runs.size(), 3u);
  EXPECT_EQ(runs[0].environment.task(), "bridge:Hopper-v5");
  EXPECT_EQ(runs[0].environment.parameters.Choice("id"), "Hopper-v5");
  EXPECT_EQ(runs[1].environment.task(), "walker_walk");
  EXPECT_EQ(runs[2].environment.task(), "bridge:my.Other:v0");
  EXPECT_NE(ConfigurationSha256(runs[0]), ConfigurationSha256(runs[2]));
  EXPECT_EQ(RunSpecFromJson(ToJson(runs[0])).environment.task(), "bridge:Hopper-v5");

  options.settings = {CommandLine("bridge.id", "Ant-v5")};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage, {"set twice", "--env"});
  options.settings = {File("bridge.id", "Ant-v5")};
  EXPECT_EQ(Resolve(options).environment.task(), "bridge:Hopper-v5");
  options.settings = {};
  options.environments = {"bridge:a", "bridge:a"};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage, {"the same component"});
  options.environments = {"walker_walk:fast"};
  ExpectRefusal([&] { Resolve(options); }, ExitCode::kUsage,
                {"'walker_walk' is one task; expected its name alone"});
}

TEST(RunParameters, AreConsistentDeclarations) {
  for (const ParameterSpec& spec : RunParameters()) {
    EXPECT_GE(spec.default_number, spec.min) << spec.name;
    EXPECT_LE(spec.default_number, spec.max) << spec.name;
    EXPECT_EQ(spec.preset_count, 2u) << spec.name;
    for (std::uint32_t i = 0; i < spec.preset_count; ++i) {
      EXPECT_GE(spec.presets[i].number, spec.min) << spec.name;
      EXPECT_LE(spec.presets[i].number, spec.max) << spec.name;
    }
  }
}

}  // namespace
}  // namespace dreamsearch
