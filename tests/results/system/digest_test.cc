#include "results/system/digest.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <set>

#include "results/database/derived_rows.h"
#include "results/system/error.h"
#include "results/system/sha256.h"

namespace dreamsearch::results {
namespace {

// FIPS 180-4's example, and the empty text.
TEST(Sha256, IsTheStandardsFunction) {
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256Hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256, AnUnreadableFileIsAnErrorThatNamesIt) {
  try {
    Sha256HexOfFile("/nowhere/at/all");
    FAIL();
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kNotFound);
    EXPECT_NE(std::string(error.what()).find("/nowhere/at/all"), std::string::npos);
  }
}

TEST(EpisodeDigest, ChangesWithEveryBitOfActionRewardAndValue) {
  const double action[] = {0.25, -0.5};
  EpisodeDigest plain;
  plain.AddDecision(action, 2, 1.5, 3.25);
  std::set<std::uint64_t> seen = {plain.state()};
  for (int which = 0; which < 4; ++which) {
    for (int bit = 0; bit < 64; ++bit) {
      double numbers[] = {0.25, -0.5, 1.5, 3.25};
      numbers[which] = std::bit_cast<double>(std::bit_cast<std::uint64_t>(numbers[which]) ^
                                             (std::uint64_t{1} << bit));
      EpisodeDigest changed;
      changed.AddDecision(numbers, 2, numbers[2], numbers[3]);
      EXPECT_TRUE(seen.insert(changed.state()).second) << which << " " << bit;
    }
  }
}

TEST(EpisodeDigest, GoesOnFromItsState) {
  const double action[] = {0.1};
  EpisodeDigest whole, first;
  whole.AddDecision(action, 1, 1, 2);
  whole.AddDecision(action, 1, 3, 4);
  first.AddDecision(action, 1, 1, 2);
  EpisodeDigest second(first.state());
  second.AddDecision(action, 1, 3, 4);
  EXPECT_EQ(second.state(), whole.state());
}

TEST(EpisodeDigest, DependsOnTheOrder) {
  EpisodeDigest ab, ba;
  ab.AddDecision(nullptr, 0, 1, 2);
  ba.AddDecision(nullptr, 0, 2, 1);
  EXPECT_NE(ab.state(), ba.state());
}

TEST(RowDigest, ChangesWithEveryField) {
  const StepRow step = {1, 2, 3, 4.5, 5.5, 6, 7, 8, 9};
  std::set<std::uint64_t> seen = {RowDigest(step)};
  const auto add = [&seen](const auto& row) { return seen.insert(RowDigest(row)).second; };
  StepRow changed;
  for (std::int64_t StepRow::*field :
       {&StepRow::env_step, &StepRow::episode, &StepRow::t, &StepRow::plan_us,
        &StepRow::simulations, &StepRow::nodes, &StepRow::depth}) {
    changed = step;
    changed.*field ^= 1;
    EXPECT_TRUE(add(changed));
  }
  for (double StepRow::*field : {&StepRow::reward, &StepRow::value}) {
    changed = step;
    changed.*field = std::nextafter(changed.*field, 10.0);
    EXPECT_TRUE(add(changed));
    changed.*field = std::nan("");
    EXPECT_TRUE(add(changed));
  }
  const EpisodeRow episode = {Phase::kTraining, 1, 1000, 1000, 50.5, 3, 4, 5, 6, 7};
  EXPECT_TRUE(add(episode));
  EpisodeRow other = episode;
  other.phase = Phase::kActorEvaluation;
  EXPECT_TRUE(add(other));
  for (double EpisodeRow::*field : {&EpisodeRow::episode_return, &EpisodeRow::wall_seconds,
                                    &EpisodeRow::plan_us_mean, &EpisodeRow::plan_us_p95}) {
    other = episode;
    other.*field += 1;
    EXPECT_TRUE(add(other));
  }
  other = episode;
  other.digest ^= 1;
  EXPECT_TRUE(add(other));
}

// A column that SQLite stores as NULL, or without the sign of zero, has one digest.
TEST(RowDigest, IsThatOfTheStoredValue) {
  StepRow a, b;
  a.value = std::nan("");
  b.value = INFINITY;
  EXPECT_EQ(RowDigest(a), RowDigest(b));
  a.value = 0.0;
  b.value = -0.0;
  EXPECT_EQ(RowDigest(a), RowDigest(b));
}

}  // namespace
}  // namespace dreamsearch::results
