// The rank correlation against its closed forms.
#include "host/acting/root_ranking.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dreamsearch {
namespace {

TEST(RankCorrelation, DependsOnTheOrderAlone) {
  EXPECT_DOUBLE_EQ(RankCorrelation({1, 2, 3, 4}, {10, 11, 500, 501}), 1);
  EXPECT_DOUBLE_EQ(RankCorrelation({1, 2, 3, 4}, {9, 1, 0, -7}), -1);
  // 1 - 6 sum d^2 / (n (n^2 - 1)), Spearman 1904: d = 1, 1, 0, 1, 1.
  EXPECT_DOUBLE_EQ(RankCorrelation({1, 2, 3, 4, 5}, {2, 1, 3, 6, 4}), 1 - 6.0 * 4 / (5 * 24));
}

TEST(RankCorrelation, EqualNumbersShareTheMeanOfTheirRanks) {
  // Ranks 0.5, 0.5, 2 and 0, 1, 2: products 0.5 + 0 + 1, squares 1.5 and 2.
  EXPECT_DOUBLE_EQ(RankCorrelation({3, 3, 8}, {1, 2, 4}), 1.5 / std::sqrt(1.5 * 2));
  EXPECT_EQ(RankCorrelation({5, 5, 5}, {1, 2, 3}), 0);
  EXPECT_EQ(RankCorrelation({}, {}), 0);
  EXPECT_EQ(RankCorrelation({1}, {2}), 0);
}

}  // namespace
}  // namespace dreamsearch
