// The whole update's gradients against central differences, in double, for every setting that
// changes what is computed. The layers' are in tests/plugins/networks.
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "plugins/model_tdmpc/learner.h"
#include "tests/plugins/networks/batches.h"
#include "tests/plugins/networks/central_difference.h"

namespace dreamsearch::tdmpc {
namespace {

struct Variant {
  const char* name;
  bool ends;  // an episode ends early
  std::function<void(Settings*)> change;
  std::vector<std::size_t> firsts = {};  // rows inside sequences that begin an episode
  std::uint64_t candidates = 0;          // of the rows' searches
};

const Variant kVariants[] = {
    {"paper", false, [](Settings*) {}},
    {"episodes_that_end", true, [](Settings*) {}},
    {"one_critic", false, [](Settings* s) { s->critics = 1; }},
    {"target_of_all", false, [](Settings* s) { s->target_of_all = true; }},
    {"deep", false, [](Settings* s) { s->encoder_layers = s->layers = 2; }},
    {"everything",
     true,
     [](Settings* s) {
       s->normalise_observations = true;
       s->observation_clip = 1.5;
       s->rho = 0.7;
       s->consistency_weight = 3;
       s->reward_weight = 2;
       s->value_weight = 5;
       s->lambda = 0.6;
       s->continuation_weight = 0.4;
       s->entropy_scale = 0.3;
       s->search_policy_weight = 0.8;
       s->search_value_weight = 0.6;
     },
     {2, 5, 7, 11},
     4},
    {"searches", false, [](Settings*) {}, {}, 2},
};

class UpdateGradient : public testing::TestWithParam<std::size_t> {};

TEST_P(UpdateGradient, OfAllGroupsEqualsCentralDifference) {
  const Variant& variant = kVariants[GetParam()];
  Settings settings = PresetSettings("paper");
  settings.latent = 2 * kSimplex;
  settings.encoder_width = 5;
  settings.width = 6;
  settings.layers = 1;
  settings.critics = 3;
  settings.bins = {.count = 9, .low = -3, .high = 3};
  settings.min_log_std = -2;
  settings.max_log_std = 1;
  variant.change(&settings);
  OwnedBatch batch = RandomBatch(3, 4, 3, 2, 21);
  std::fill(batch.discounts.begin(), batch.discounts.end(), 1.0f);
  if (variant.ends) batch.discounts[3] = batch.discounts[6] = 0;
  for (const std::size_t row : variant.firsts) batch.is_first[row] = 1;
  if (variant.candidates > 0) batch.AddSearches(variant.candidates, 22);
  Learner<double> learner(settings, 3, 2, 5);
  Agent<double>& agent = learner.agent();
  for (std::size_t g = 0; g < kGroups; ++g) Perturb(&agent.groups[g], 11 + g);
  agent.target.Reset(agent.groups[kCritic]);
  Perturb(&agent.groups[kCritic], 15);
  agent.Pack();
  ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
  UpdateLosses losses{};
  learner.Gradients(&losses);
  EXPECT_EQ(losses[kContinuationLoss] > 0, variant.ends);
  const Stops<double> stops = learner.stops();
  const auto loss = [&](const double* which) {
    return [&, which] {
      agent.Pack();
      learner.Gradients(&losses, &stops);
      return *which;
    };
  };
  ExpectCentralDifferences(variant.name, {{&agent.groups[kEncoder], loss(&losses[kModelLoss])},
                                          {&agent.groups[kModel], loss(&losses[kModelLoss])},
                                          {&agent.groups[kCritic], loss(&losses[kModelLoss])},
                                          {&agent.groups[kActor], loss(&losses[kActorLoss])}});
}

INSTANTIATE_TEST_SUITE_P(Variants, UpdateGradient,
                         testing::Range<std::size_t>(0, std::size(kVariants)),
                         [](const auto& row) { return std::string(kVariants[row.param].name); });

// The least value is mixed with what the search found, where there is one.
TEST(Searches, MoveTheTargetsOfTheStatesSearchedByTheirShare) {
  Settings settings = PresetSettings("paper");
  settings.latent = kSimplex;
  settings.encoder_width = settings.width = 6;
  OwnedBatch batch = RandomBatch(2, 4, 3, 2, 21);
  const auto targets = [&](double share) {
    settings.search_value_weight = share;
    Learner<double> learner(settings, 3, 2, 5);
    EXPECT_TRUE(learner.Read(batch.view(), 77).ok());
    UpdateLosses losses{};
    learner.Gradients(&losses);
    return learner.stops().targets;  // time-major
  };
  const Values without = targets(0.25);
  batch.AddSearches(2, 22);
  EXPECT_EQ(targets(0), without);
  const Values quarter = targets(0.25), whole = targets(1);
  int moved = 0;
  for (std::size_t t = 0; t < 3; ++t) {
    for (std::size_t b = 0; b < 2; ++b) {
      const std::size_t row = b * 4 + t + 1, column = t * 2 + b;
      const bool counts = row % 3 != 0 && batch.discounts[row] != 0;
      moved += counts;
      const double found =
          counts ? static_cast<double>(batch.rewards[row]) +
                       settings.discount * static_cast<double>(batch.search_values[row])
                 : without[column];
      EXPECT_NEAR(whole[column], found, 1e-12);
      EXPECT_NEAR(quarter[column], 0.75 * without[column] + 0.25 * found, 1e-12);
    }
  }
  EXPECT_GT(moved, 1);
}

// An episode that begins inside a sequence, and all that comes after it there, changes no
// gradient of what came before.
TEST(Sequences, WhatComesAfterAnEpisodesEndCountsForNothing) {
  Settings settings = PresetSettings("paper");
  settings.latent = kSimplex;
  settings.encoder_width = settings.width = 6;
  std::vector<Values> gradients;
  for (const bool ends : {true, false}) {
    for (const float shift : {0.0f, 1.0f}) {
      OwnedBatch batch = RandomBatch(1, 5, 3, 2, 21);
      std::fill(batch.discounts.begin(), batch.discounts.end(), 1.0f);
      batch.is_first[3] = ends ? 1 : 0;
      for (std::size_t i = 3 * 3; i < 5 * 3; ++i) batch.observations[i] += shift;
      for (std::size_t i = 3 * 2; i < 5 * 2; ++i) batch.actions[i] += shift;
      batch.rewards[4] += shift;
      Learner<double> learner(settings, 3, 2, 5);
      for (std::size_t g = 0; g < kGroups; ++g) Perturb(&learner.agent().groups[g], 11 + g);
      ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
      UpdateLosses losses{};
      learner.Gradients(&losses);
      Values& all = gradients.emplace_back();
      for (const ParameterGroup<double>& group : learner.agent().groups) {
        all.insert(all.end(), group.gradient(), group.gradient() + group.size());
      }
    }
  }
  EXPECT_EQ(gradients[0], gradients[1]);
  EXPECT_NE(gradients[2], gradients[3]);
}

}  // namespace
}  // namespace dreamsearch::tdmpc
