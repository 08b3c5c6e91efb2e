// What a learner takes from searches: the imitation loss, its gradient and its bounds.
#include "plugins/networks/search_targets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/plugins/networks/batches.h"
#include "tests/plugins/networks/central_difference.h"

namespace dreamsearch::networks {
namespace {

constexpr Index kA = 3;

// The nll of row 1 of the batch under a Gaussian of one column; `gradient` receives that in mean
// and deviation.
double Nll(const OwnedBatch& batch, const std::vector<double>& gaussian,
           std::vector<double>* gradient = nullptr) {
  ActorShape shape;
  shape.min_log_std = -10;
  shape.max_log_std = 2;
  Imitation<double> imitation;
  imitation.Begin(batch.view(), shape, kA, 1);
  const double nll =
      imitation.Add(1, 1, {gaussian.data(), kA, 1}, {gaussian.data() + kA, kA, 1}, 0);
  if (gradient != nullptr) {
    const Mat<const double> found = imitation.gradient();
    gradient->assign(found.data, found.data + 2 * kA);
  }
  return nll;
}

OwnedBatch OneSearch() {
  OwnedBatch batch = RandomBatch(1, 2, 1, kA, 3);
  batch.AddSearches(4, 5);
  return batch;
}

TEST(Imitation, IsTheCandidatesLikelihoodBeforeTanh) {
  OwnedBatch batch = OneSearch();
  batch.search_weights = {0, 0, 0, 0, 0, 1, 0, 0};
  const std::vector<double> gaussian = {0.3, -0.2, 1.1, 0.5, 0.0, 2.0};
  double expected = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double u = std::atanh(static_cast<double>(batch.search_actions[5 * 3 + i]));
    const double variance = gaussian[3 + i] * gaussian[3 + i] + 0.01;
    expected += (u - gaussian[i]) * (u - gaussian[i]) / (2 * variance) +
                std::log(2 * std::numbers::pi * variance) / 2;
  }
  EXPECT_NEAR(Nll(batch, gaussian), expected / 3, 1e-12);
}

TEST(Imitation, GradientEqualsCentralDifference) {
  const OwnedBatch batch = OneSearch();
  std::vector<double> gaussian = {0.3, -0.2, 1.1, 0.5, 1e-3, 2.0}, gradient;
  Nll(batch, gaussian, &gradient);
  for (std::size_t i = 0; i < gaussian.size(); ++i) {
    constexpr double kStepSize = 1e-6;
    std::vector<double> above = gaussian, below = gaussian;
    above[i] += kStepSize;
    below[i] -= kStepSize;
    const double difference = (Nll(batch, above) - Nll(batch, below)) / (2 * kStepSize);
    EXPECT_NEAR(gradient[i], difference, 1e-7 * (1 + std::abs(difference))) << i;
  }
}

TEST(Imitation, GradientIsBoundedForActionsAtTheBoundsAndVanishingDeviations) {
  OwnedBatch batch = OneSearch();
  std::fill(batch.search_actions.begin(), batch.search_actions.end(), 1.0f);
  std::vector<double> gradient;
  for (const double deviation : {0.0, 1e-6, 0.05, 0.1, 1.0}) {
    EXPECT_TRUE(std::isfinite(Nll(batch, {0, 0, 0, deviation, deviation, deviation}, &gradient)));
    const double error = std::atanh(0.999);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_LE(std::abs(gradient[i]), error / 0.01 / 3 + 1e-9);
      EXPECT_LE(std::abs(gradient[3 + i]), error * error / 0.001 / 3 + 1e-9);
    }
  }
}

TEST(Searches, ARowWithoutWeightsWasNotSearched) {
  const OwnedBatch batch = OneSearch();
  EXPECT_FALSE(Searched(batch.view(), 0));
  EXPECT_TRUE(Searched(batch.view(), 1));
  EXPECT_EQ(WithSearchValue(batch.view(), 0, 0.5, 7.0), 7.0);
  EXPECT_EQ(WithSearchValue(batch.view(), 1, 0.0, 7.0), 7.0);
  EXPECT_NEAR(WithSearchValue(batch.view(), 1, 0.25, 7.0),
              5.25 + 0.25 * static_cast<double>(batch.search_values[1]), 1e-12);
}

}  // namespace
}  // namespace dreamsearch::networks
