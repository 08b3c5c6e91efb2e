// What cannot be run is refused in one line, and nothing is written.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

struct Refused {
  std::vector<std::string> arguments;
  int exit_status;
  const char* message;
};

TEST(Refusal, NamesWhatIsKnownAndWritesNothing) {
  const Refused cases[] = {
      {{"--env", "walker_wlak", "--planner", "mcts_pw"}, 66, "Did you mean walker_walk?"},
      {{"--env", "walker_walk", "--planner", "mcts_wp"}, 66, "mcts_fixed"},
      {{"--env", "walker_walk", "--planner", "dreamer", "--model", "dremer"}, 66, "dreamer"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--set", "planner.simulatoins=5"},
       2,
       "simulations"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--set", "mcts_pw.simulations=0"},
       2,
       "from 1 to"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--set", "mcts_pw.simulations=many"},
       2,
       "many"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--seeds", "0"}, 2, "seeds"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--seed-list", "-1"}, 2, "-1"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--stesp", "5"}, 2, "steps"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--config", "absent.cfg"},
       66,
       "absent.cfg"},
      {{"--env", "walker_walk", "--planner", "dreamer", "--set", "run.search_targets=true"},
       2,
       "expected a planner that reports its improved policy, found 'dreamer'. Known: cem, "},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--model", "idle_model", "--plugin-path",
        DREAMSEARCH_FAULTY_PLUGIN_DIR, "--set", "run.search_targets=true"},
       2,
       "expected a model that learns from searches, found 'idle_model'"},
      {{"--env", "walker_walk", "--planner", "mcts_pw", "--set", "run.reanalyse=0.1"},
       2,
       "run.reanalyse: expected run.search_targets=true beside it"},
      {{"--planner", "mcts_pw"}, 2, "--env"},
      {{"trian"}, 2, "no command 'trian'"},
      {{"status", "--db", "absent.db"}, 66, "absent.db"},
  };
  const Workplace place;
  for (const Refused& refused : cases) {
    std::vector<std::string> arguments = refused.arguments;
    const ProgramResult result = place.Runner(arguments);
    EXPECT_EQ(result.exit_status, refused.exit_status) << result.err;
    EXPECT_NE(result.err.find(refused.message), std::string::npos) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(result.err.rfind("error: ", 0), 0u) << result.err;
    EXPECT_TRUE(std::filesystem::is_empty(place.folder())) << result.err;
  }
}

TEST(Refusal, AFileThatIsNotOurDatabaseIsLeftAlone) {
  const Workplace place;
  {
    std::FILE* file = std::fopen(place.Path("notes.txt").c_str(), "w");
    std::fputs("my notes, precious to me, long enough to be no header of any kind\n", file);
    std::fclose(file);
  }
  const ProgramResult result = place.Runner(TinyRun("cartpole_balance", "dreamer", "notes.txt"));
  EXPECT_EQ(result.exit_status, 65) << result.err;
  EXPECT_EQ(std::filesystem::file_size(place.folder() / "notes.txt"), 66u);
}

// A folder that is gone, links in a circle, names too long: what was wrong and where, and never "a
// defect of runner".
TEST(Refusal, APlaceThatCannotBeIsNoDefect) {
  const Workplace place;
  ASSERT_EQ(std::system(("ln -s loop '" + place.Path("loop") + "'").c_str()), 0);
  ASSERT_EQ(place.Runner(TinyRun("cartpole_balance", "random", "p.db")).exit_status, 0);
  const std::string longest(300, 'x');
  const auto expect = [&](const ProgramResult& result, int code, const std::string& name) {
    EXPECT_EQ(result.exit_status, code) << result.err;
    EXPECT_NE(result.err.find(name), std::string::npos) << result.err;
    EXPECT_EQ(result.err.find("defect"), std::string::npos) << result.err;
  };
  for (const std::string& name : {std::string("loop"), std::string("loop/x"), longest}) {
    expect(place.Results({"list", "--db", name}), 73, name);
    expect(place.Runner({"--env", "cartpole_balance", "--planner", "random", "--db", name}), 73,
           name);
    // Beside the link there may be files.
    const int written = name == "loop" ? 0 : 73;
    const std::string said = written == 0 ? "" : name;
    expect(place.Results({"report", name + ".html", "--db", "p.db"}), written, said);
    expect(place.Results({"curves", "--out", name + ".csv", "--db", "p.db"}), written, said);
    expect(place.Runner({"export", "1", "--out", name, "--db", "p.db"}), 73, name);
  }
  for (const std::string& command :
       {std::string("results list --db p.db"),
        std::string("runner --env cartpole_balance --planner random --db p.db")}) {
    const std::string gone = place.Path("gone");
    const int status = std::system(("mkdir '" + gone + "' && cd '" + gone + "' && rmdir '" + gone +
                                    "' && " DREAMSEARCH_TEST_BIN_DIR "/" + command + " 2> '" +
                                    place.Path("said") + "'")
                                       .c_str());
    EXPECT_EQ(WEXITSTATUS(status), 66) << command;
  }
}

TEST(DryRun, ShowsRunsSettingsTimeAndBytesAndWritesNothing) {
  const Workplace place;
  std::vector<std::string> arguments =
      TinyRun("cartpole_balance", "dreamer,mcts_pw", "d.db", {"--dry-run", "--seeds", "2"});
  const ProgramResult result = place.Runner(arguments);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_NE(result.out.find("cartpole_balance mcts_pw seed 1: start"), std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("mcts_pw.simulations = 6"), std::string::npos) << result.out;
  // A setting that both planners' runs share stands there once.
  const auto first = result.out.find("run.batch_size = 4");
  ASSERT_NE(first, std::string::npos) << result.out;
  EXPECT_EQ(result.out.find("run.batch_size = 4", first + 1), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("total: 4 of 4 runs"), std::string::npos) << result.out;
  EXPECT_TRUE(std::filesystem::is_empty(place.folder()));
}

TEST(DryRun, SaysThatNothingCanBeWrittenThere) {
  const Workplace place;
  std::fclose(std::fopen(place.Path("file").c_str(), "w"));
  const ProgramResult result =
      place.Runner(TinyRun("cartpole_balance", "dreamer", "file/sub/d.db", {"--dry-run"}));
  EXPECT_EQ(result.exit_status, 73) << result.err;
  EXPECT_NE(result.err.find(place.Path("file") + ": is not a folder"), std::string::npos)
      << result.err;
  const ProgramResult nothing = place.Runner(TinyRun("cartpole_balance", "dreamer", ""));
  EXPECT_EQ(nothing.exit_status, 2) << nothing.err;
  EXPECT_NE(nothing.err.find("found nothing. Name one with --db"), std::string::npos)
      << nothing.err;
}

TEST(DryRun, WarnsOfABudgetThatEndsBeforeLearning) {
  const Workplace place;
  std::vector<std::string> arguments = TinyRun("cartpole_balance", "dreamer", "w.db");
  std::replace(arguments.begin(), arguments.end(), std::string("4000"), std::string("500"));
  std::vector<std::string> dry = arguments;
  dry.emplace_back("--dry-run");
  for (const auto& with : {dry, arguments}) {
    const ProgramResult result = place.Runner(with);
    EXPECT_EQ(result.exit_status, 0) << result.err;
    EXPECT_NE(result.err.find("warning: --steps 500 is not more than run.prefill_steps = 1000"),
              std::string::npos)
        << result.err;
    EXPECT_EQ(result.err.find("1 runs:"), std::string::npos) << result.err;
  }
}

TEST(Describe, TakesAPluginsName) {
  const Workplace place;
  const ProgramResult plugin = place.Runner({"describe", "planner_shooting"});
  EXPECT_EQ(plugin.exit_status, 0) << plugin.err;
  for (const char* text :
       {"plugin planner_shooting", "planner  cem ", "runner describe planner/"}) {
    EXPECT_NE(plugin.out.find(text), std::string::npos) << plugin.out;
  }
  const ProgramResult misspelt = place.Runner({"describe", "planer_shooting"});
  EXPECT_EQ(misspelt.exit_status, 66) << misspelt.err;
  EXPECT_NE(misspelt.err.find("Did you mean planner_shooting?"), std::string::npos) << misspelt.err;
}

}  // namespace
}  // namespace dreamsearch
