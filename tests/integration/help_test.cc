// `--help`, `--version` and wrong command lines, of every command of both programs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <sstream>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

using Words = std::vector<std::string>;

struct CommandName {
  std::string program;
  std::string command;  // empty: the program itself

  Words With(const Words& more) const {
    Words words = command.empty() ? Words{} : Words{command};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::string text() const { return program + (command.empty() ? "" : " " + command); }
};

class EveryCommand : public testing::Test {
 protected:
  ProgramResult Run(const CommandName& name, const Words& more) const {
    const Words words = name.With(more);
    return name.program == "runner" ? place_.Runner(words) : place_.Results(words);
  }

  // Those that the programs' help lists, and the programs.
  std::vector<CommandName> Names() const {
    std::vector<CommandName> names;
    for (const char* program : {"runner", "results"}) {
      names.push_back({program, ""});
      std::istringstream lines(Run({program, ""}, {"--help"}).out);
      bool below = false;
      for (std::string line; std::getline(lines, line);) {
        if (line.empty() || line[0] != ' ') below = line == "Commands";
        std::istringstream words(line);
        std::string word;
        if (below && line[0] == ' ' && words >> word && word != "COMMAND") {
          names.push_back({program, word});
        }
      }
    }
    EXPECT_EQ(names.size(), 2u + 10u + 15u);
    return names;
  }

  const Workplace place_;
};

// Summary, usage, examples, then groups of which the last is the same everywhere.
TEST_F(EveryCommand, HelpHasTheOneForm) {
  for (const CommandName& name : Names()) {
    const ProgramResult result = Run(name, {"--help"});
    EXPECT_EQ(result.exit_status, 0) << name.text() << result.err;
    EXPECT_EQ(result.err, "") << name.text();
    EXPECT_EQ(Run(name, {"--no-such-flag", "-h"}).out, result.out) << name.text();
    const std::string& out = result.out;
    EXPECT_EQ(out.find(name.text() + " - "), 0u) << out;
    const std::size_t summary = out.find('\n');
    EXPECT_EQ(out.find("\n\nUsage\n  " + name.text()), summary) << out;
    EXPECT_NE(out.find("\n\nExamples\n  " + name.program + " "), std::string::npos) << out;
    EXPECT_NE(
        out.find("\n\nGeneral\n  -h, --help  show this text\n  --version   show the version\n"),
        std::string::npos)
        << out;
    std::istringstream lines(out);
    for (std::string line; std::getline(lines, line);) {
      EXPECT_LE(line.size(), 100u) << line;
      EXPECT_EQ(line.find_last_not_of(' ') + 1, line.size()) << "'" << line << "'";
    }
  }
}

TEST_F(EveryCommand, HasAVersion) {
  for (const CommandName& name : Names()) {
    const ProgramResult result = Run(name, {"--version"});
    EXPECT_EQ(result.exit_status, 0) << name.text() << result.err;
    EXPECT_EQ(std::count(result.out.begin(), result.out.end(), '\n'), 1) << result.out;
  }
}

// Each long flag of each help, without its last letter but one.
TEST_F(EveryCommand, AMisspeltFlagIsAUsageErrorThatNamesTheRightOne) {
  for (const CommandName& name : Names()) {
    std::istringstream lines(Run(name, {"--help"}).out);
    int tried = 0;
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("  --", 0) != 0) continue;
      const std::string flag = line.substr(2, line.find(' ', 2) - 2);
      if (flag.size() < 6) continue;  // so short that nothing is near
      std::string misspelt = flag;
      std::swap(misspelt[misspelt.size() - 1], misspelt[misspelt.size() - 2]);
      if (misspelt == flag) continue;
      const ProgramResult result = Run(name, {misspelt});
      EXPECT_EQ(result.exit_status, 2) << name.text() << " " << misspelt;
      EXPECT_EQ(result.err, "error: " + name.text() + ": no flag '" + misspelt +
                                "'. Did you mean " + flag + "? `" + name.text() +
                                " --help` lists the flags.\n");
      EXPECT_EQ(result.out, "");
      ++tried;
    }
    EXPECT_GE(tried, 1) << name.text();
  }
}

// Flags with a value have its name after one space.
TEST_F(EveryCommand, AFlagWithoutItsValueIsAUsageError) {
  for (const CommandName& name : Names()) {
    std::istringstream lines(Run(name, {"--help"}).out);
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("  --", 0) != 0) continue;
      const std::size_t end = line.find(' ', 2);
      if (end == std::string::npos || end + 1 >= line.size() || line[end + 1] == ' ') continue;
      const std::string flag = line.substr(2, end - 2);
      const ProgramResult result = Run(name, {flag});
      EXPECT_EQ(result.exit_status, 2) << name.text() << " " << flag;
      EXPECT_EQ(result.err,
                "error: " + name.text() + ": " + flag + ": expected a value, found none\n");
    }
  }
}

TEST_F(EveryCommand, AMisspeltNameIsAUsageErrorThatNamesTheRightOne) {
  for (const CommandName& name : Names()) {
    if (name.command.empty()) continue;
    const ProgramResult result = Run({name.program, name.command + "x"}, {});
    EXPECT_EQ(result.exit_status, 2) << result.err;
    EXPECT_NE(result.err.find("error: " + name.program + ": no command '" + name.command + "x'"),
              std::string::npos)
        << result.err;
    EXPECT_NE(result.err.find("Did you mean " + name.command), std::string::npos) << result.err;
  }
}

TEST_F(EveryCommand, AValueOutOfRangeIsAUsageErrorThatSaysWhatIsExpected) {
  const struct {
    CommandName name;
    Words words;
    const char* message;
  } cases[] = {
      {{"runner", ""}, {"--jobs", "-1"}, "runner: --jobs: expected a whole number from 0 to 10000"},
      {{"runner", "list"}, {"plannets"}, "Did you mean planners?"},
      {{"runner", "eval"}, {"--seeds", "-1"}, "runner eval: --seeds: expected a whole number"},
      {{"runner", "resume"}, {"--time-limit", "soon"}, "--time-limit: expected a duration"},
      {{"runner", "verify"}, {"1", "--memory-limit", "4X"}, "--memory-limit: expected a size"},
      {{"runner", "explain"}, {"1", "--decision", "-1"}, "--decision: expected a whole number"},
      {{"results", "list"}, {"--format", "jsn"}, "Did you mean json?"},
      {{"results", "curves"}, {"--smooth", "2"}, "--smooth: expected an odd number"},
      {{"results", "compare"}, {"--repetitions", "3"}, "from 100 to 10000000, found '3'"},
      {{"results", "export"}, {"--rows", "episdes"}, "Did you mean episodes?"},
      {{"results", "import"}, {"a", "--steps-per-unit", "0"}, "--steps-per-unit: expected"},
      {{"results", "delete"}, {"--seed", "x"}, "--seed: expected a whole number"},
  };
  for (const auto& wrong : cases) {
    const ProgramResult result = Run(wrong.name, wrong.words);
    EXPECT_EQ(result.exit_status, 2) << wrong.name.text() << result.err;
    EXPECT_NE(result.err.find(wrong.message), std::string::npos) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(result.out, "");
  }
  EXPECT_TRUE(std::filesystem::is_empty(place_.folder()));
}

TEST(Help, OffersWhatMeansSomethingThere) {
  const Workplace place;
  const auto offers = [&](const char* command, const char* flag) {
    return place.Runner({command, "--help"}).out.find(flag) != std::string::npos;
  };
  EXPECT_FALSE(offers("verify", "--retry") || offers("verify", "--replace"));
  EXPECT_TRUE(offers("resume", "--retry"));
  EXPECT_FALSE(offers("resume", "--replace"));
  EXPECT_TRUE(offers("eval", "--retry") && offers("eval", "--replace"));
}

TEST(Help, SaysHowToBegin) {
  const Workplace place;
  const ProgramResult result = place.Runner({"--help"});
  EXPECT_EQ(result.exit_status, 0);
  for (const char* word : {"--env", "--planner", "--seeds", "--db", "resume", "describe"}) {
    EXPECT_NE(result.out.find(word), std::string::npos) << word;
  }
}

// As `runner --help | head` does: the reader is gone before anything is written.
TEST(Help, SaysNothingToAReaderWhoLeft) {
  const Workplace place;
  const std::string command =
      "cd '" + place.folder().string() +
      "' && { while [ ! -e left ]; do sleep 0.01; done; " DREAMSEARCH_TEST_BIN_DIR
      "/runner --help 2>err; echo $? >status; } | { exec <&-; touch left; }; "
      "while [ ! -s status ]; do sleep 0.01; done; "
      "[ ! -s err ] && [ \"$(cat status)\" = 0 ]";
  EXPECT_EQ(std::system(command.c_str()), 0);
}

}  // namespace
}  // namespace dreamsearch
