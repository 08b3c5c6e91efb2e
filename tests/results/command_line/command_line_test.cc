// What a declaration of flags comes to: answers, help and error texts.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>

#include "results/command_line/help.h"
#include "results/command_line/program.h"
#include "results/command_line/values.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

enum class Taste { kSweet, kSour };

struct Bake {
  std::string cake, oven = "kitchen";
  std::vector<std::string> toppings, guests, notes;
  std::optional<Taste> taste;
  int layers = 2;
  double seconds = 0;
  std::uint64_t bytes = 0;
  bool hot = false, cold = false;

  CommandSpec Declare() {
    const Choices<Taste> tastes = {{"sweet", Taste::kSweet, {"0"}}, {"sour", Taste::kSour}};
    return {.name = "cook bake",
            .summary = "bakes a cake",
            .examples = {"cook bake tart --for ada"},
            .about = "A cake needs guests.",
            .arguments = {{"", "CAKE", Text(&cake).Required(), "what to bake"}},
            .groups = {{"What goes in",
                        {{"topping", "LIST", ListOf(&toppings), "what goes on top"},
                         {"taste", "TASTE", OneOf(&taste, tastes).Default("as it comes"),
                          "how it tastes"},
                         {"layers", "N", Whole(&layers, 1, 9), "layers of the cake"},
                         {"for", "NAMES", Names(&guests).Required(), "who eats it"}}},
                       {"How",
                        {{"oven", "NAME", Text(&oven), "which oven"},
                         {"time", "TIME", Duration(&seconds), "how long"},
                         {"size", "SIZE", Size(&bytes), "how large"},
                         {"note", "TEXT", Texts(&notes), "a note"},
                         {"hot", "", Switch(&hot), "serve it hot"},
                         {"cold", "", Switch(&cold), "serve it cold"},
                         {"recipe", "FILE", FlagsFile(), "read flags from this file"}}}},
            .exclusive = {{"hot", "cold"}}};
  }
  int Run() { return 3; }
};

Bake Baked(const Words& more) {
  Bake bake;
  Words words = {"tart", "--for", "ada"};
  words.insert(words.end(), more.begin(), more.end());
  ReadCommandLine(bake.Declare(), words);
  return bake;
}

std::string Refused(const std::function<void()>& action, ExitCode code) {
  try {
    action();
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "nothing was refused";
  return "";
}

std::string Usage(const Words& more) {
  return Refused([&] { Baked(more); }, ExitCode::kUsage);
}

TEST(CommandLine, WhatIsNotGivenStaysAsItWas) {
  const Bake bake = Baked({});
  EXPECT_EQ(bake.cake, "tart");
  EXPECT_EQ(bake.guests, Words{"ada"});
  EXPECT_EQ(bake.oven, "kitchen");
  EXPECT_EQ(bake.layers, 2);
  EXPECT_FALSE(bake.taste);
  EXPECT_FALSE(bake.hot);
}

TEST(CommandLine, EveryKindOfValueIsRead) {
  const Bake bake =
      Baked({"--topping", "nuts,,figs", "--topping=cream", "--taste", "0", "--layers", "9",
             "--time", "1.5h", "--size", "4k", "--note", "a,b", "--note", "-1", "--hot"});
  EXPECT_EQ(bake.toppings, (Words{"nuts", "figs", "cream"}));
  EXPECT_EQ(bake.taste, Taste::kSweet);
  EXPECT_EQ(bake.layers, 9);
  EXPECT_EQ(bake.seconds, 5400);
  EXPECT_EQ(bake.bytes, 4096u);
  EXPECT_EQ(bake.notes, (Words{"a,b", "-1"}));
  EXPECT_TRUE(bake.hot);
}

TEST(CommandLine, TextMayBeginWithDashesAndASpace) {
  Bake bake;
  ReadCommandLine(bake.Declare(), {"--for", "ada", "-- why\ntart", "--hot"});
  EXPECT_EQ(bake.cake, "-- why\ntart");
  EXPECT_TRUE(bake.hot);
  EXPECT_EQ(Baked({"--note", "-- aside"}).notes, Words{"-- aside"});
}

TEST(CommandLine, AnErrorSaysWhereWhatWasExpectedAndWhatWasFound) {
  EXPECT_EQ(Usage({"--layers", "10"}),
            "cook bake: --layers: expected a whole number from 1 to 9, found '10'");
  EXPECT_EQ(Usage({"--taste", "swet"}),
            "cook bake: --taste: expected sweet (0) or sour, found 'swet'. Did you mean sweet?");
  EXPECT_EQ(Usage({"--time", "soon"}),
            "cook bake: --time: expected a duration such as 90, 90s, 30m or 2h, found 'soon'");
  EXPECT_EQ(Usage({"--layers"}), "cook bake: --layers: expected a value, found none");
  EXPECT_EQ(Usage({"--oven="}), "cook bake: --oven: expected a value, found none");
  EXPECT_EQ(Usage({"--hot=yes"}), "cook bake: --hot: expected no value, found one");
  EXPECT_EQ(Usage({"--oven", "a", "--oven", "b"}),
            "cook bake: --oven is given twice; expected it once");
  EXPECT_EQ(Usage({"--hot", "--cold"}), "cook bake: expected --hot or --cold, found both");
}

TEST(CommandLine, AMisspeltFlagIsAnsweredWithTheNearestOne) {
  EXPECT_EQ(
      Usage({"--tiem", "3"}),
      "cook bake: no flag '--tiem'. Did you mean --time? `cook bake --help` lists the flags.");
  EXPECT_EQ(
      Usage({"--tiem=3"}),
      "cook bake: no flag '--tiem'. Did you mean --time? `cook bake --help` lists the flags.");
  EXPECT_EQ(Usage({"-hot"}),
            "cook bake: no flag '-hot'. Did you mean --hot? `cook bake --help` lists the flags.");
  EXPECT_EQ(Usage({"--lay", "3"}).find("cook bake: no flag '--lay'"), 0u);  // no abbreviation
  EXPECT_EQ(Usage({"pie"}),
            "cook bake: did not expect the argument 'pie'. `cook bake --help` lists the flags.");
  EXPECT_EQ(Usage({"hot"}),
            "cook bake: did not expect the argument 'hot'. Did you mean --hot? `cook bake --help` "
            "lists the flags.");
}

TEST(CommandLine, WhatMustBeThereIsAskedForWithItsHelpAndAnExample) {
  const auto read = [](const Words& words) {
    return Refused([&] { ReadCommandLine(Bake().Declare(), words); }, ExitCode::kUsage);
  };
  EXPECT_EQ(read({"--for", "ada"}),
            "cook bake: expected CAKE (what to bake), found none. Example: cook bake tart --for "
            "ada");
  EXPECT_EQ(read({"tart"}),
            "cook bake: expected --for NAMES (who eats it), found none. Example: cook bake tart "
            "--for ada");
}

TEST(CommandLine, AFoundTextCannotSteerTheTerminal) {
  EXPECT_NE(Usage({"--layers", "\033[2J"}).find("found '\\x1b[2J'"), std::string::npos);
}

class FileOfFlags : public testing::Test {
 protected:
  std::string Write(const std::string& text) {
    std::ofstream(path_, std::ios::binary) << text;
    return path_;
  }
  void TearDown() override { std::remove(path_.c_str()); }

  const std::string path_ = (std::filesystem::temp_directory_path() /
                             ("dreamsearch-flags-" + std::to_string(::getpid()) + ".cfg"))
                                .string();
};

TEST_F(FileOfFlags, TheCommandLineWinsAndListsAreJoined) {
  Write("oven = garden  # outside\nlayers = 5\nnote = file\nhot = off\n");
  const Bake bake = Baked({"--recipe", path_, "--layers", "3", "--note", "line"});
  EXPECT_EQ(bake.oven, "garden");
  EXPECT_EQ(bake.layers, 3);
  EXPECT_EQ(bake.notes, (Words{"line", "file"}));
  EXPECT_FALSE(bake.hot);
}

TEST_F(FileOfFlags, WhatIsRequiredMayStandInTheFile) {
  Bake bake;
  ReadCommandLine(bake.Declare(), {"tart", "--recipe", Write("for = eve\n")});
  EXPECT_EQ(bake.guests, Words{"eve"});
}

TEST_F(FileOfFlags, AMistakeIsSaidWithItsLineAlsoIfTheCommandLineHidesIt) {
  Write("oven = garden\nlayers = many\n");
  EXPECT_EQ(Refused(
                [&] {
                  Baked({"--recipe", path_, "--layers", "3"});
                },
                ExitCode::kBadInput),
            path_ + ", line 2: layers: expected a whole number from 1 to 9, found 'many'");
  Write("hot = perhaps\n");
  EXPECT_EQ(Refused(
                [&] {
                  Baked({"--recipe", path_});
                },
                ExitCode::kBadInput),
            path_ + ", line 1: hot: expected true or false, found 'perhaps'");
  Write("recipe = other.cfg\n");
  EXPECT_EQ(Refused(
                [&] {
                  Baked({"--recipe", path_});
                },
                ExitCode::kBadInput),
            path_ + ", line 1: recipe is for the command line only");
  Write("hot = on\ncold = on\n");
  EXPECT_EQ(
      Refused(
          [&] {
            Baked({"--recipe", path_});
          },
          ExitCode::kBadInput),
      path_ + ", line 2: expected hot or cold, found both; the other is in " + path_ + ", line 1");
}

TEST(Help, ComesFromTheDeclaration) {
  EXPECT_EQ(HelpText(Bake().Declare()), R"(cook bake - bakes a cake

Usage
  cook bake CAKE --for NAMES [flags]

Examples
  cook bake tart --for ada

A cake needs guests.

Arguments
  CAKE  what to bake

What goes in
  --topping LIST  what goes on top; repeatable
  --taste TASTE   how it tastes; one of sweet (0) or sour (default: as it comes)
  --layers N      layers of the cake (default: 2)
  --for NAMES     who eats it

How
  --oven NAME    which oven (default: kitchen)
  --time TIME    how long
  --size SIZE    how large
  --note TEXT    a note; repeatable
  --hot          serve it hot
  --cold         serve it cold
  --recipe FILE  read flags from this file

General
  -h, --help  show this text
  --version   show the version
)");
}

TEST(Help, ALongTextGoesOnBelowItself) {
  const std::string text =
      TwoColumns("Flags", {{"--a-flag-whose-name-is-long VALUE", "short"},
                           {"--b", std::string(40, 'x') + " " + std::string(60, 'y')}});
  EXPECT_EQ(text, "\nFlags\n  --a-flag-whose-name-is-long VALUE\n       short\n  --b  " +
                      std::string(40, 'x') + "\n       " + std::string(60, 'y') + "\n");
}

Program Cook() {
  return {
      .version = "cook 1.2",
      .root = {{.name = "cook", .summary = "cooks"}, nullptr},
      .commands = {MakeCommand<Bake>()},
      .internal = {{"stir", [](const Words& words) { return static_cast<int>(words.size()); }}}};
}

TEST(Program, RunsTheCommandThatTheFirstWordNames) {
  EXPECT_EQ(RunProgram(Cook(), {"bake", "tart", "--for", "ada"}), 3);
  EXPECT_EQ(RunProgram(Cook(), {"stir", "a", "b"}), 2);
  EXPECT_EQ(Refused([] { RunProgram(Cook(), {"bkae"}); }, ExitCode::kUsage),
            "cook: no command 'bkae'. Known: bake. Did you mean bake?");
}

TEST(Program, HelpAndVersionNeedNothingElse) {
  for (const Words& words : {Words{"bake", "--nonsense", "-h"}, Words{"--help"}, Words{"help"},
                             Words{"bake", "--version"}, Words{"--version"}}) {
    EXPECT_EQ(RunProgram(Cook(), words), 0);
  }
  EXPECT_EQ(RunProgram(Cook(), {}), 2);
}

TEST(Program, HelpListsTheCommandsThatExistAndNoOthers) {
  const std::string help = ProgramHelp(Cook());
  EXPECT_NE(help.find("\nCommands\n  bake            bakes a cake\n  COMMAND --help"),
            std::string::npos)
      << help;
  EXPECT_EQ(help.find("stir"), std::string::npos) << help;
}

TEST(Program, EndsWithTheCodeOfTheFailure) {
  EXPECT_EQ(ExitStatusOf("cook", [] { return 7; }), 7);
  EXPECT_EQ(ExitStatusOf("cook", []() -> int { throw Failure(ExitCode::kDiverged, "boiled"); }),
            72);
  EXPECT_EQ(ExitStatusOf("cook", []() -> int { throw std::runtime_error("burnt"); }), 70);
}

}  // namespace
}  // namespace dreamsearch
