// Suggestions for names that are not known.
#include "results/system/error.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "results/text/names.h"

namespace dreamsearch {
namespace {

using Names = std::vector<std::string>;

const Names kPlanners = {"cem", "dreamer", "mcts_fixed", "mcts_pw", "rollout"};

TEST(NearestNames, FindsTheNameAFewEditsAway) {
  EXPECT_EQ(NearestNames("mcts_wp", kPlanners), Names{"mcts_pw"});
  EXPECT_EQ(NearestNames("Rollout", kPlanners), Names{"rollout"});
  EXPECT_EQ(NearestNames("dremer", kPlanners), Names{"dreamer"});
  EXPECT_EQ(NearestNames("ecm", kPlanners), Names{"cem"});
}

TEST(NearestNames, FindsNothingWhereNothingIsNear) {
  EXPECT_EQ(NearestNames("hoot", kPlanners), Names{});
  EXPECT_EQ(NearestNames("", kPlanners), Names{});
  EXPECT_EQ(NearestNames(std::string(100000, 'x'), kPlanners), Names{});
}

TEST(NearestNames, GivesAllThatAreEquallyNearAndElseTheBeginnings) {
  EXPECT_EQ(NearestNames("walk", {"wall", "talk", "run"}), (Names{"wall", "talk"}));
  EXPECT_EQ(NearestNames("mcts", kPlanners), (Names{"mcts_fixed", "mcts_pw"}));
}

TEST(KnownNames, ListsThemAndAsks) {
  EXPECT_EQ(KnownNames("ecm", {"cem", "hoot"}), "Known: cem, hoot. Did you mean cem?");
  EXPECT_EQ(KnownNames("walk", {"wall", "talk"}), "Known: wall, talk. Did you mean wall or talk?");
  EXPECT_EQ(KnownNames("x", {"cem"}), "Known: cem.");
  EXPECT_EQ(KnownNames("x", {}), "Known: none.");
}

}  // namespace
}  // namespace dreamsearch
