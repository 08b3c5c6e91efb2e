// Every gradient of the model's own against central differences, in double: the returns, the
// whole update for every setting that changes what is computed, and a transition. The layers'
// are in tests/plugins/networks.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "plugins/model_dreamer/behaviour.h"
#include "plugins/model_dreamer/learner.h"
#include "tests/plugins/networks/batches.h"
#include "tests/plugins/networks/central_difference.h"

namespace dreamsearch::dreamer {
namespace {

TEST(LambdaReturns, GradientEqualsCentralDifference) {
  constexpr Index kN = 5;
  ExpectCentralDifferences(
      {"lambda_returns", 4 * kN * 2 + 5 * kN, 4 * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         const double* rewards = in->data();
         const double* discounts = rewards + 4 * kN;
         const double* values = discounts + 4 * kN;
         LambdaReturns<double>(4, kN, 0.9, rewards, discounts, values, out->data());
         if (d == nullptr) return;
         Values copy = *ct;
         LambdaReturnsBackward<double>(4, kN, 0.9, discounts, values, out->data(), copy.data(),
                                       d->data(), d->data() + 4 * kN, d->data() + 8 * kN);
       }},
      10);
}

struct Variant {
  const char* name;
  std::function<void(Settings*)> change;
  std::vector<std::size_t> firsts = {};  // rows inside sequences that begin an episode
  std::uint64_t candidates = 0;          // of the rows' searches
};

const Variant kVariants[] = {
    {"paper", [](Settings*) {}},
    {"free_nats_reached", [](Settings* s) { s->free_nats = 10; }},
    {"free_nats_per_step",
     [](Settings* s) {
       s->free_nats_per_step = true;
       s->free_nats = 2;  // near the mean: some steps above, some below
     }},
    {"continuation", [](Settings* s) { s->continuation = true; }},
    {"layer_norm", [](Settings* s) { s->layer_norm = true; }},
    {"weights_and_scales",
     [](Settings* s) {
       s->normalise_observations = true;
       s->observation_weight = 3;
       s->reward_weight = 7;
       s->kl_scale = 0.5;
       s->value_scale = 20;
       s->entropy_scale = 0.1;
       s->slow_critic_weight = 0.5;
     }},
    {"everything",
     [](Settings* s) {
       s->continuation = true;
       s->layer_norm = true;
       s->normalise_observations = true;
       s->reward_weight = 7;
       s->value_scale = 20;
       s->entropy_scale = 0.1;
       s->slow_critic_weight = 0.5;
       s->imagination_starts = 5;
       s->start_skip = 1;
       s->search_policy_weight = 0.8;
       s->search_value_weight = 0.6;
     },
     {},
     4},
    {"searches", [](Settings*) {}, {}, 2},
    {"three_critics",
     [](Settings* s) {
       s->critics = 3;
       s->slow_critic_weight = 0.5;
       s->value_scale = 20;
     }},
    {"least_of_critics",
     [](Settings* s) {
       s->critics = 3;
       s->least_of_critics = true;
       s->slow_critic_weight = 0.5;
     }},
    {"episodes_end_inside", [](Settings* s) { s->continuation = true; }, {2, 5, 6, 11}},
};

Settings SmallSettings() {
  Settings s = PresetSettings("paper");
  s.deterministic = 6;
  s.stochastic = 4;
  s.hidden = 7;
  s.horizon = 4;
  s.free_nats = 0;
  s.actor_initial_std = 0.7;
  return s;
}

void MakeReady(Learner<double>* learner) {
  Perturb(&learner->world().group(), 11);
  Perturb(&learner->behaviour().actor(), 12);
  Perturb(&learner->behaviour().value(), 13);
  learner->behaviour().ResetSlow();
  Perturb(&learner->behaviour().value(), 14);
  learner->PackWeights();
}

class UpdateGradient : public testing::TestWithParam<std::size_t> {};

TEST_P(UpdateGradient, OfAllThreeGroupsEqualsCentralDifference) {
  const Variant& variant = kVariants[GetParam()];
  Settings settings = SmallSettings();
  variant.change(&settings);
  OwnedBatch batch = RandomBatch(3, 4, 3, 2, 21);
  for (const std::size_t row : variant.firsts) batch.is_first[row] = 1;
  if (variant.candidates > 0) batch.AddSearches(variant.candidates, 22);
  Learner<double> learner(settings, 3, 2, 5);
  MakeReady(&learner);
  ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
  UpdateLosses losses;
  learner.Gradients(&losses);
  const DreamStops<double> stops = learner.behaviour().Stops();
  // The model's parameters are differenced through the fit, the others through the
  // dream, from the posterior states of the fit above.
  const auto fit = [&] {
    learner.PackWeights();
    learner.FitGradients(&losses);
    return losses.fit.total;
  };
  const auto dream = [&](const double* loss) {
    learner.PackWeights();
    learner.DreamGradients(&losses, &stops);
    return *loss;
  };
  ExpectCentralDifferences(
      variant.name, {{&learner.behaviour().actor(), [&] { return dream(&losses.dream.actor); }},
                     {&learner.behaviour().value(), [&] { return dream(&losses.dream.value); }},
                     {&learner.world().group(), fit}});
}

INSTANTIATE_TEST_SUITE_P(Variants, UpdateGradient,
                         testing::Range<std::size_t>(0, std::size(kVariants)),
                         [](const auto& row) { return std::string(kVariants[row.param].name); });

TEST(Sequences, WhatCameBeforeAnEpisodeDoesNotReachIntoIt) {
  const Index length = 6, first = 2;
  Settings settings = SmallSettings();
  settings.normalise_observations = false;
  std::vector<Values> later;
  for (const float shift : {0.0f, 1.0f}) {
    OwnedBatch batch = RandomBatch(1, length, 3, 2, 21);
    for (Index i = 0; i < 3 * first; ++i) batch.observations[static_cast<std::size_t>(i)] += shift;
    for (Index i = 0; i < 2 * first; ++i) batch.actions[static_cast<std::size_t>(i)] += shift;
    for (const bool ends : {true, false}) {
      batch.is_first[static_cast<std::size_t>(first)] = ends ? 1 : 0;
      Learner<double> learner(settings, 3, 2, 5);
      MakeReady(&learner);
      ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
      UpdateLosses losses;
      learner.FitGradients(&losses);
      const M states = learner.world().states();
      later.emplace_back(states.col(first), states.col(first) + states.rows * (length - first));
    }
  }
  EXPECT_EQ(later[0], later[2]);
  EXPECT_NE(later[1], later[3]);
}

// The factors of the divergence scale the gradient, not the loss, so they are
// checked by linearity: the halves add up, and the prior's own weights feel only
// the prior's half.
TEST(KlFactors, SplitTheDivergencesGradientIntoPriorAndPosterior) {
  const OwnedBatch batch = RandomBatch(3, 4, 3, 2, 21);
  const auto gradient = [&](double prior, double posterior) {
    Settings settings = SmallSettings();
    settings.observation_weight = settings.reward_weight = 0;
    settings.kl_prior_factor = prior;
    settings.kl_posterior_factor = posterior;
    Learner<double> learner(settings, 3, 2, 5);
    MakeReady(&learner);
    EXPECT_TRUE(learner.Read(batch.view(), 77).ok());
    UpdateLosses losses;
    learner.Gradients(&losses);
    ParameterGroup<double>& group = learner.world().group();
    Values values;
    std::vector<bool> of_prior;
    for (const Tensor& tensor : group.tensors()) {
      for (Index k = 0; k < tensor.rows * tensor.cols; ++k) {
        values.push_back(group.gradient()[tensor.offset + k]);
        of_prior.push_back(tensor.name.starts_with("prior."));
      }
    }
    return std::pair(values, of_prior);
  };
  const auto [both, of_prior] = gradient(1, 1);
  const Values prior = gradient(1, 0).first;
  const Values posterior = gradient(0, 1).first;
  const Values mixed = gradient(0.5, 0.25).first;
  for (std::size_t i = 0; i < both.size(); ++i) {
    EXPECT_NEAR(prior[i] + posterior[i], both[i], 1e-12);
    EXPECT_NEAR(0.5 * prior[i] + 0.25 * posterior[i], mixed[i], 1e-12);
    if (of_prior[i]) {
      EXPECT_DOUBLE_EQ(prior[i], both[i]);
      EXPECT_DOUBLE_EQ(posterior[i], 0);
    }
  }
}

// A whole update's gradient in bfloat16 points where the float gradient does.
TEST(Bfloat16, UpdateGradientFollowsTheFloatGradient) {
  if (!Bfloat16Available()) GTEST_SKIP() << "no bfloat16 in the instruction set in use";
  const OwnedBatch batch = PointBatch(8, 16, 1);
  std::vector<std::vector<double>> gradients[2];
  for (const bool bfloat16 : {false, true}) {
    Settings settings = PresetSettings("paper");
    settings.bfloat16 = bfloat16;
    settings.free_nats = 0;
    settings.horizon = 5;
    Learner<float> learner(settings, 2, 1, 5);
    ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
    UpdateLosses losses;
    learner.Gradients(&losses);
    for (const ParameterGroup<float>* group :
         {&learner.world().group(), &learner.behaviour().actor(), &learner.behaviour().value()}) {
      gradients[bfloat16].emplace_back(group->gradient(), group->gradient() + group->size());
    }
  }
  for (std::size_t g = 0; g < 3; ++g) {
    double dot = 0, exact = 0, rounded = 0;
    for (std::size_t i = 0; i < gradients[0][g].size(); ++i) {
      dot += gradients[0][g][i] * gradients[1][g][i];
      exact += gradients[0][g][i] * gradients[0][g][i];
      rounded += gradients[1][g][i] * gradients[1][g][i];
    }
    const double cosine = dot / std::sqrt(exact * rounded);
    Show("bfloat16 1 - cosine", 1 - cosine);
    // Rounding errs by 2^-9 a factor; some tens of factors in a row, as angles add
    // up, stay within a few percent: cosine above 1 - 0.05^2 / 2.
    EXPECT_GT(cosine, 0.998) << "group " << g;
  }
}

// One step of dynamics, whose input gradients the actor's learning rests on.
TEST(Transition, BackwardEqualsCentralDifference) {
  for (const bool norm : {false, true}) {
    Settings settings = SmallSettings();
    settings.layer_norm = norm;
    WorldModel<double> world(settings, 3, 2);
    world.group().Allocate(3);
    Perturb(&world.group(), 4);
    const Index s = settings.state_size(), n = 3;
    Values inputs = Draws(static_cast<std::size_t>((s + 2) * n), 5);
    Values noise = Draws(static_cast<std::size_t>(settings.stochastic * n), 6);
    Values cotangent = Draws(static_cast<std::size_t>(s * n), 7), out(cotangent.size());
    const M state(inputs.data(), s, n), action(inputs.data() + s * n, 2, n);
    const M eps(noise.data(), settings.stochastic, n), next(out.data(), s, n);
    TransitionTape<double> tape;
    world.Reserve(n, &tape);
    const auto loss = [&] {
      world.Step(world.group().exact(), state, action, eps, 0, &tape, next);
      double total = 0;
      for (std::size_t i = 0; i < out.size(); ++i) total += cotangent[i] * out[i];
      return total;
    };
    loss();
    Values d_next = cotangent, gradient(inputs.size());
    world.StepBackward(world.group().exact(), state, next, eps, 0, &tape, M(d_next.data(), s, n),
                       M(gradient.data(), s, n), M(gradient.data() + s * n, 2, n));
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const double kept = inputs[i];
      inputs[i] = kept + kStep;
      const double above = loss();
      inputs[i] = kept - kStep;
      const double below = loss();
      inputs[i] = kept;
      EXPECT_LT(Residual(gradient[i], (above - below) / (2 * kStep), 1e-2), kTolerance)
          << "norm " << norm << " input " << i;
    }
  }
}

}  // namespace
}  // namespace dreamsearch::dreamer
