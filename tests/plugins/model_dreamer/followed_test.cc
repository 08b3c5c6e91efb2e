// The way of an imagined return back to its actions against central differences, in double, for
// every setting that changes what is computed.
#include "plugins/model_dreamer/followed.h"

#include <gtest/gtest.h>

#include <functional>

#include "plugins/model_dreamer/learner.h"
#include "tests/plugins/networks/central_difference.h"

namespace dreamsearch::dreamer {
namespace {

struct Variant {
  const char* name;
  bool mean;  // transitions without noise
  std::function<void(Settings*)> change;
};

const Variant kVariants[] = {
    {"paper", false, [](Settings*) {}},
    {"mean_latents", true, [](Settings*) {}},
    {"continuation", false, [](Settings* s) { s->continuation = true; }},
    {"layer_norm", false, [](Settings* s) { s->layer_norm = true; }},
    {"everything", true,
     [](Settings* s) {
       s->continuation = true;
       s->layer_norm = true;
       s->value_scale = 20;
       s->critics = 3;
     }},
};

TEST(Followed, TheGradientOfItsActionsEqualsCentralDifference) {
  constexpr Index kA = 2, kN = 3, kHorizon = 4, kSteps = kN * kHorizon;
  for (const Variant& variant : kVariants) {
    Settings settings = PresetSettings("paper");
    settings.deterministic = 6;
    settings.stochastic = 3;
    settings.hidden = 5;
    variant.change(&settings);
    Learner<double> learner(settings, 3, kA, 5);
    Perturb(&learner.world().group(), 11);
    Perturb(&learner.behaviour().value(), 12);
    learner.PackWeights();
    const Index state = settings.state_size();
    Values from = Draws(static_cast<std::size_t>(state * kN), 31);
    Values draws = Draws(static_cast<std::size_t>(settings.stochastic * kSteps), 32);
    const M states(from.data(), state, kN);
    const M noise = variant.mean ? M() : M(draws.data(), settings.stochastic, kSteps);
    Followed<double> followed;
    ExpectCentralDifferences(
        {variant.name, kA * kSteps, 2 * kSteps + static_cast<std::size_t>(settings.critics * kN),
         [&](Values* in, Values* out, Values* ct, Values* d) {
           const M actions(in->data(), kA, kSteps);
           Slices outputs(out->data());
           const M rewards = outputs.Take(1, kSteps), discounts = outputs.Take(1, kSteps);
           followed.Forward(settings, learner.world(), learner.behaviour(), states, actions, noise,
                            rewards, discounts.data, outputs.Take(settings.critics, kN));
           if (d == nullptr) return;
           Slices cotangents(ct->data());
           const M d_rewards = cotangents.Take(1, kSteps), d_discounts = cotangents.Take(1, kSteps);
           followed.Backward(settings, learner.world(), learner.behaviour(), noise, d_rewards,
                             d_discounts, cotangents.Take(settings.critics, kN),
                             M(d->data(), kA, kSteps));
         }},
        40);
  }
}

}  // namespace
}  // namespace dreamsearch::dreamer
