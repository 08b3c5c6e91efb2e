#include "dreamsearch/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace dreamsearch {
namespace {

TEST(Random, DrawIMatchesTheCounterForm) {
  constexpr std::uint64_t kSeed = 42;
  Random random(kSeed);
  for (std::uint64_t i = 0; i < 100; ++i) {
    EXPECT_EQ(random.Next(), MixBits(kSeed + (i + 1) * kGoldenGamma));
  }
}

// The published first outputs of SplitMix64 for seed 1234567.
TEST(Random, IsSplitMix64) {
  Random random(1234567);
  EXPECT_EQ(random.Next(), 6457827717110365317ull);
  EXPECT_EQ(random.Next(), 3203168211198807973ull);
  EXPECT_EQ(random.Next(), 9817491932198370423ull);
}

TEST(Random, NormalHasTheMomentsOfANormal) {
  Random random(7);
  constexpr int kDraws = 200000;
  double sum = 0, squares = 0, fourths = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Normal();
    ASSERT_TRUE(std::isfinite(x));
    sum += x;
    squares += x * x;
    fourths += x * x * x * x;
  }
  // Five standard errors of the mean, the variance and the fourth moment.
  EXPECT_NEAR(sum / kDraws, 0, 5 * std::sqrt(1.0 / kDraws));
  EXPECT_NEAR(squares / kDraws, 1, 5 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(fourths / kDraws, 3, 5 * std::sqrt(96.0 / kDraws));
}

TEST(Random, BelowCoversItsRangeAndNoMore) {
  Random random(3);
  std::set<std::uint64_t> seen;
  for (int i = 0; i < 1000; ++i) seen.insert(random.Below(7));
  EXPECT_EQ(seen.size(), 7u);
  EXPECT_EQ(*seen.rbegin(), 6u);
}

TEST(FillSeeds, GivesRowITheStreamIWhateverTheNumberOfRows) {
  std::uint64_t few[3], many[9];
  FillSeeds(11, {few, 3});
  FillSeeds(11, {many, 9});
  for (std::uint64_t i = 0; i < 9; ++i) EXPECT_EQ(many[i], DeriveSeed(11, i));
  for (std::uint64_t i = 0; i < 3; ++i) EXPECT_EQ(few[i], many[i]);
}

TEST(DeriveSeed, NeighbouringSeedsAndStreamsDiffer) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    for (std::uint64_t stream = 0; stream < 100; ++stream) seen.insert(DeriveSeed(seed, stream));
  }
  EXPECT_EQ(seen.size(), 10000u);
  EXPECT_NE(DeriveSeed(DeriveSeed(1, 2), 3), DeriveSeed(DeriveSeed(1, 3), 2));
}

}  // namespace
}  // namespace dreamsearch
