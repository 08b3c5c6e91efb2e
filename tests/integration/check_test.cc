// `runner check` on plugins as they come: good, broken, not loadable.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

constexpr char kFaultyPlugin[] = DREAMSEARCH_FAULTY_PLUGIN_DIR "/faulty.so";

TEST(CheckCommand, AGoodComponentKeepsEveryLawAndExitsWithZero) {
  const Workplace place;
  const ProgramResult result = place.Runner({"check", "planner/random"});
  EXPECT_EQ(result.exit_status, 0) << result.out << result.err;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  // A sanitizer has to be the first library, so that nothing counts allocations.
  const char* const counts = "random: 15 laws kept, 0 not kept, 3 skipped";
#else
  const char* const counts = "random: 16 laws kept, 0 not kept, 2 skipped";
#endif
  EXPECT_NE(result.out.find(counts), std::string::npos) << result.out;
}

TEST(CheckCommand, ABrokenLawIsNamedWithWhatWasFoundAndWhatToDo) {
  const Workplace place;
  const ProgramResult result = place.Runner(
      {"check", "outside_action", "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR, "--law", "P3"});
  EXPECT_EQ(result.exit_status, 78) << result.err;
  for (const char* said : {"P3    BROKEN", "expected", "found", "to do", kFaultyPlugin}) {
    EXPECT_NE(result.out.find(said), std::string::npos) << said << '\n' << result.out;
  }
}

TEST(CheckCommand, AFaultThatManyCasesShareIsPrintedOnce) {
  const Workplace place;
  const ProgramResult result = place.Runner(
      {"check", "null_planner", "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR, "--law", "C6"});
  EXPECT_EQ(result.exit_status, 78) << result.err;
  EXPECT_NE(result.out.find("A = 1, latents of 64 bytes;"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("A = 64, latents"), std::string::npos) << result.out;
  const std::size_t first = result.out.find("\n                   expected ");
  EXPECT_NE(first, std::string::npos) << result.out;
  EXPECT_EQ(result.out.find("\n                   expected ", first + 1), std::string::npos)
      << result.out;
}

TEST(CheckCommand, ACrashIsLocatedAndTheOtherComponentsAreChecked) {
  const Workplace place;
  const ProgramResult result = place.Runner({"check", kFaultyPlugin, "--level", "make", "--json",
                                             "--case-limit", "2", "--memory-limit", "100M"});
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(result.exit_status, json.at("exit_status")) << result.err;
  std::string segfault, null;
  for (const auto& component : json.at("components")) {
    for (const auto& outcome : component.at("outcomes")) {
      if (outcome.at("law") != "C3") continue;
      if (component.at("name") == "no_latent") null = outcome.at("found");
      if (component.at("name") == "null_planner") segfault = outcome.at("found");
    }
  }
  EXPECT_EQ(null, "0");
  EXPECT_EQ(segfault, "null");
}

TEST(CheckCommand, WhatIsNotThereOrNoPluginHasTheCodeOfItsRefusal) {
  const Workplace place;
  EXPECT_EQ(place.Runner({"check", "gone.so"}).exit_status, 66);
  const ProgramResult unknown = place.Runner({"check", "mcts_wp"});
  EXPECT_EQ(unknown.exit_status, 66);
  EXPECT_NE(unknown.err.find("Did you mean mcts_pw?"), std::string::npos) << unknown.err;
  EXPECT_EQ(place.Runner({"check", DREAMSEARCH_TEST_BIN_DIR "/gone/"}).exit_status, 66);
  const ProgramResult folder = place.Runner({"check", DREAMSEARCH_TEST_BIN_DIR});
  EXPECT_EQ(folder.exit_status, 66);
  EXPECT_NE(folder.err.find(DREAMSEARCH_TEST_BIN_DIR ", a folder"), std::string::npos)
      << folder.err;
  EXPECT_EQ(place.Runner({"check", DREAMSEARCH_TEST_BIN_DIR "/runner"}).exit_status, 69);
}

TEST(CheckCommand, ASettingThatNobodyHasIsRefused) {
  const Workplace place;
  const ProgramResult parameter =
      place.Runner({"check", "mcts_pw", "--set", "mcts_pw.simulatoins=3"});
  EXPECT_EQ(parameter.exit_status, 2);
  EXPECT_NE(parameter.err.find("Did you mean simulations?"), std::string::npos) << parameter.err;
  const ProgramResult component = place.Runner({"check", "mcts_pw", "--set", "cem.horizon=3"});
  EXPECT_EQ(component.exit_status, 2);
  EXPECT_NE(component.err.find("no component that is checked is called 'cem'"), std::string::npos)
      << component.err;
  EXPECT_EQ(place.Runner({"check", "mcts_pw", "--law", "P99"}).exit_status, 2);
}

}  // namespace
}  // namespace dreamsearch
