// The way of an imagined return back to its actions against central differences, in double, for
// every setting that changes what is computed.
#include "plugins/model_tdmpc/followed.h"

#include <gtest/gtest.h>

#include "tests/plugins/networks/central_difference.h"

namespace dreamsearch::tdmpc {
namespace {

struct Variant {
  const char* name;
  Index critics;
  Index layers;
  bool ends;  // episodes ended early
};

constexpr Variant kVariants[] = {{"paper", 3, 1, false},
                                 {"one_critic", 1, 1, false},
                                 {"deep", 2, 2, false},
                                 {"ends", 3, 1, true}};

TEST(Followed, TheGradientOfItsActionsEqualsCentralDifference) {
  constexpr Index kA = 2, kN = 3, kHorizon = 4, kSteps = kN * kHorizon;
  for (const Variant& variant : kVariants) {
    Settings settings = PresetSettings("paper");
    settings.latent = 2 * kSimplex;
    settings.encoder_width = 5;
    settings.width = 6;
    settings.layers = variant.layers;
    settings.critics = variant.critics;
    settings.bins = {.count = 9, .low = -3, .high = 3};
    settings.min_log_std = -2;
    settings.max_log_std = 1;
    Agent<double> agent(settings, 3, kA, 5);
    for (std::size_t g = 0; g < kGroups; ++g) Perturb(&agent.groups[g], 11 + g);
    agent.ends_seen = variant.ends ? 1 : 0;
    Values from = Draws(static_cast<std::size_t>(settings.latent * kN), 31);
    const M latents(from.data(), settings.latent, kN);
    SimNorm(latents);
    Followed<double> followed;
    const auto critics = static_cast<std::size_t>(variant.critics);
    ExpectCentralDifferences(
        {variant.name, kA * kSteps, 2 * kSteps + critics * kN,
         [&](Values* in, Values* out, Values* ct, Values* d) {
           const M actions(in->data(), kA, kSteps);
           Slices outputs(out->data());
           const M rewards = outputs.Take(1, kSteps), discounts = outputs.Take(1, kSteps);
           followed.Forward(agent, latents, actions, rewards, discounts.data,
                            outputs.Take(variant.critics, kN));
           if (d == nullptr) return;
           Slices cotangents(ct->data());
           const M d_rewards = cotangents.Take(1, kSteps), d_discounts = cotangents.Take(1, kSteps);
           followed.Backward(agent, d_rewards, d_discounts, cotangents.Take(variant.critics, kN),
                             M(d->data(), kA, kSteps));
         }},
        40);
  }
}

}  // namespace
}  // namespace dreamsearch::tdmpc
