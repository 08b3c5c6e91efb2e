// laws_test.cc - each law fails for the component that breaks it, and for nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include "dreamsearch/check/check.h"
#include "tests/sdk/check/broken.h"

namespace dreamsearch::check {
namespace {

class LawTest : public testing::TestWithParam<BrokenComponent> {};

TEST_P(LawTest, FailsForTheComponentThatBreaksItAlone) {
  const BrokenComponent& broken = GetParam();
  Options options;
  options.level = broken.level;
  options.case_seconds = 60;
  std::set<std::string> failed;
  for (const Outcome& outcome :
       Check({.component = broken.component, .settings = broken.settings}, options)) {
    if (outcome.law == broken.law && outcome.found.find("count allocations") != std::string::npos) {
      GTEST_SKIP() << outcome.found;
    }
    if (outcome.good()) continue;
    failed.insert(outcome.law);
    if (outcome.law != broken.law) ADD_FAILURE() << Describe(outcome);
    EXPECT_EQ(outcome.verdict, broken.verdict) << Describe(outcome);
    EXPECT_FALSE(outcome.expected.empty()) << Describe(outcome);
    EXPECT_FALSE(outcome.advice.empty()) << Describe(outcome);
    EXPECT_NE(outcome.found.find(broken.found), std::string::npos) << Describe(outcome);
  }
  EXPECT_EQ(failed,
            broken.law.empty() ? std::set<std::string>{} : std::set<std::string>{broken.law});
}

std::string NameOf(const testing::TestParamInfo<BrokenComponent>& info) {
  return (info.param.law.empty() ? "None" : info.param.law) + "_" + std::to_string(info.index);
}
INSTANTIATE_TEST_SUITE_P(Planners, LawTest, testing::ValuesIn(BrokenPlanners()), NameOf);
INSTANTIATE_TEST_SUITE_P(Models, LawTest, testing::ValuesIn(BrokenModels()), NameOf);
INSTANTIATE_TEST_SUITE_P(Environments, LawTest, testing::ValuesIn(BrokenEnvironments()), NameOf);

TEST(Laws, EveryOneHasAComponentThatBreaksIt) {
  std::set<std::string> broken = {"C1"};  // of the loader, see below
  for (const auto& some : {BrokenPlanners(), BrokenModels(), BrokenEnvironments()}) {
    for (const BrokenComponent& component : some) broken.insert(component.law);
  }
  for (const LawInfo& law : AllLaws()) {
    EXPECT_TRUE(broken.contains(law.number)) << law.number << " " << law.title;
  }
}

// With its title, so that a reader of either finds the other.
TEST(Laws, EveryOneStandsInTheReadmeWithItsReason) {
  std::ifstream file(DREAMSEARCH_SOURCE_DIR "/sdk/README.md");
  const std::string page((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  for (const LawInfo& law : AllLaws()) {
    const std::string row = "| " + law.number + " | " + law.title + " | ";
    EXPECT_NE(page.find(row), std::string::npos) << row;
  }
}

TEST(Laws, ALibraryThatTakesItsTimeBreaksTheFirst) {
  EXPECT_EQ(LoadOutcome(0.09).verdict, Verdict::kKept);
  const Outcome late = LoadOutcome(0.25);
  EXPECT_EQ(late.verdict, Verdict::kBroken);
  EXPECT_EQ(late.found, "250 ms");
}

class DyingTest : public testing::TestWithParam<BrokenComponent> {};

TEST_P(DyingTest, IsContainedAndLocated) {
  const BrokenComponent& dying = GetParam();
  Options options;
  options.case_seconds = 0.5;
  options.memory_bytes = 64 << 20;
  const std::vector<Outcome> outcomes =
      Check({.component = dying.component, .settings = {}}, options);
  ASSERT_FALSE(outcomes.empty());
  const Outcome& last = outcomes.back();
  EXPECT_EQ(last.law, dying.law);
  EXPECT_EQ(last.verdict, dying.verdict) << Describe(last);
  EXPECT_NE(last.found.find(dying.found), std::string::npos) << last.found;
}
INSTANTIATE_TEST_SUITE_P(Planners, DyingTest, testing::ValuesIn(DyingPlanners()));

TEST(Check, RefusesASettingThatIsNotDeclared) {
  const BrokenComponent good = BrokenPlanners().front();
  EXPECT_THROW(Check({.component = good.component, .settings = {{"depht", 3, ""}}}),
               std::invalid_argument);
}

TEST(Check, HoldsOnlyTheLawsAskedFor) {
  const BrokenComponent good = BrokenPlanners().front();
  Options options;
  options.only = {"P4"};
  const std::vector<Outcome> outcomes =
      Check({.component = good.component, .settings = {}}, options);
  ASSERT_EQ(outcomes.size(), 1u);
  EXPECT_EQ(outcomes.front().law, "P4");
  options.in_this_process = true;
  EXPECT_EQ(Check({.component = good.component, .settings = {}}, options).front().verdict,
            Verdict::kKept);
}

}  // namespace
}  // namespace dreamsearch::check
