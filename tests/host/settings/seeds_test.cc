#include "host/settings/seeds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace dreamsearch {
namespace {

TEST(SeedFor, EveryArgumentMatters) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t run = 0; run < 5; ++run) {
    for (const SeedUse use : {SeedUse::kEnvironment, SeedUse::kPlan, SeedUse::kTrain}) {
      for (const EpisodePurpose phase : {EpisodePurpose::kTraining, EpisodePurpose::kEvaluation}) {
        for (std::uint64_t episode = 0; episode < 5; ++episode) {
          for (std::uint64_t decision = 0; decision < 5; ++decision) {
            seen.insert(SeedFor(run, use, phase, episode, decision));
          }
        }
      }
    }
  }
  EXPECT_EQ(seen.size(), 5u * 3 * 2 * 5 * 5);
}

TEST(HeldDecision, DrawsAreHeldForSoManyDecisionsOnAverage) {
  for (const std::uint64_t hold : {1u, 4u, 20u}) {
    std::uint64_t decisions = 0, draws = 0;
    for (std::uint64_t episode = 0; episode < 100; ++episode) {
      std::uint64_t before = 0;
      for (std::uint64_t decision = 0; decision < 500; ++decision) {
        const std::uint64_t drawn =
            HeldDecision(7, EpisodePurpose::kTraining, episode, decision, hold);
        // Its own, or that of the decision before: never one from in between.
        ASSERT_TRUE(drawn == decision || (decision > 0 && drawn == before));
        ++decisions;
        draws += drawn == decision;
        before = drawn;
      }
    }
    const double share = 1.0 / static_cast<double>(hold);
    const double deviation = std::sqrt(share * (1 - share) * static_cast<double>(decisions));
    EXPECT_NEAR(static_cast<double>(draws), share * static_cast<double>(decisions - 100) + 100,
                4 * deviation + 100);
  }
}

}  // namespace
}  // namespace dreamsearch
