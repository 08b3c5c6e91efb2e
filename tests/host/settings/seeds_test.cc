#include "host/settings/seeds.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace dreamsearch
