// Distributions over bins and simplices: closed forms, limits, NaN, and the law of rows.
#include "plugins/networks/categorical.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "dreamsearch/random.h"

namespace dreamsearch::networks {
namespace {

template <typename T>
class CategoricalOf : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(CategoricalOf, Scalars);

template <typename T>
std::vector<T> Draws(Index count, std::uint64_t seed) {
  Random random(seed);
  std::vector<T> values(static_cast<std::size_t>(count));
  for (T& v : values) v = static_cast<T>(3 * random.Normal());
  return values;
}

TYPED_TEST(CategoricalOf, SimNormIsTheSoftmaxOfEveryEightRows) {
  using T = TypeParam;
  std::vector<T> x = Draws<T>(3 * kSimplex * 5, 1);
  x[3] = 200;  // exp would overflow
  std::vector<T> y = x;
  SimNorm(Mat<T>(y.data(), 3 * kSimplex, 5));
  for (std::size_t first = 0; first < x.size(); first += kSimplex) {
    const auto largest = static_cast<double>(
        *std::max_element(x.begin() + static_cast<std::ptrdiff_t>(first),
                          x.begin() + static_cast<std::ptrdiff_t>(first + kSimplex)));
    double sum = 0;
    for (std::size_t k = first; k < first + kSimplex; ++k) {
      sum += std::exp(static_cast<double>(x[k]) - largest);
    }
    for (std::size_t k = first; k < first + kSimplex; ++k) {
      EXPECT_NEAR(static_cast<double>(y[k]), std::exp(static_cast<double>(x[k]) - largest) / sum,
                  4 * static_cast<double>(std::numeric_limits<T>::epsilon()));
    }
  }
}

// Logits whose softmax is a two-hot distribution give the number back, and have a gradient of
// zero.
TYPED_TEST(CategoricalOf, ANumberReturnsFromItsTwoBins) {
  using T = TypeParam;
  const Bins bins{.count = 101, .low = -10, .high = 10};
  for (const double number : {0.0, 0.3, -7.0, 1.0, 150.0, -2000.0, 1e9}) {
    const double y = std::copysign(std::log1p(std::abs(number)), number);
    std::vector<T> logits(101), d(101);
    T value = 0;
    for (std::size_t i = 0; i < logits.size(); ++i) {
      const double bin = -10 + 0.2 * static_cast<double>(i);
      const double p = std::max(0.0, 1 - std::abs(std::min(y, 10.0) - bin) / 0.2);
      logits[i] = static_cast<T>(std::log(std::max(p, 1e-30)));
    }
    TwoHotValue<T>(Mat<T>(logits.data(), 101, 1), bins, Mat<T>(d.data(), 101, 1),
                   Mat<T>(&value, 1, 1));
    const double expected = std::copysign(std::expm1(std::min(std::abs(y), 10.0)), y);
    // A mean over 20 in symlog space is off by some roundings, and symexp multiplies them.
    const double tolerance = 40 * static_cast<double>(std::numeric_limits<T>::epsilon());
    EXPECT_NEAR(static_cast<double>(value), expected, tolerance * (1 + std::abs(expected)));
    const T target = static_cast<T>(number), weight = 1;
    TwoHotError<T>(Mat<T>(logits.data(), 101, 1), Mat<const T>(&target, 1, 1),
                   Mat<const T>(&weight, 1, 1), bins, Mat<T>(d.data(), 101, 1));
    for (const T g : d) EXPECT_NEAR(static_cast<double>(g), 0, tolerance) << number;
  }
}

TYPED_TEST(CategoricalOf, NanStaysNanAndNoTargetMayBeInfinite) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN(), inf = std::numeric_limits<T>::infinity();
  const Bins bins{.count = 21, .low = -3, .high = 3};
  for (const std::size_t place : {0u, 7u, 15u, 20u}) {
    std::vector<T> logits = Draws<T>(21, 2), d(21);
    logits[place] = nan;
    T value = 0;
    TwoHotValue<T>(Mat<T>(logits.data(), 21, 1), bins, Mat<T>(d.data(), 21, 1),
                   Mat<T>(&value, 1, 1));
    EXPECT_TRUE(std::isnan(value)) << place;
    const T target = 1, weight = 1;
    EXPECT_TRUE(
        std::isnan(TwoHotError<T>(Mat<T>(logits.data(), 21, 1), Mat<const T>(&target, 1, 1),
                                  Mat<const T>(&weight, 1, 1), bins, Mat<T>(d.data(), 21, 1))));
    std::vector<T> x = Draws<T>(3 * kSimplex, 3);
    x[place] = nan;
    SimNorm(Mat<T>(x.data(), 3 * kSimplex, 1));
    EXPECT_TRUE(std::isnan(x[place / kSimplex * kSimplex])) << place;
  }
  for (const T bad : {nan, inf, -inf}) {
    std::vector<T> logits = Draws<T>(21, 2), d(21);
    const T weight = 1;
    EXPECT_TRUE(
        std::isnan(TwoHotError<T>(Mat<T>(logits.data(), 21, 1), Mat<const T>(&bad, 1, 1),
                                  Mat<const T>(&weight, 1, 1), bins, Mat<T>(d.data(), 21, 1))));
    EXPECT_TRUE(std::isnan(d[4]));
  }
}

TYPED_TEST(CategoricalOf, AColumnHasTheSameBitsWhateverStandsBesideIt) {
  using T = TypeParam;
  constexpr Index kRows = 2 * kSimplex, kCols = 9;
  const Bins bins{.count = kRows, .low = -3, .high = 3};
  const std::vector<T> x = Draws<T>(kRows * kCols, 4);
  std::vector<T> together = x, values(kCols), probabilities(x.size());
  SimNorm(Mat<T>(together.data(), kRows, kCols));
  TwoHotValue<T>(Mat<const T>(x.data(), kRows, kCols), bins,
                 Mat<T>(probabilities.data(), kRows, kCols), Mat<T>(values.data(), 1, kCols));
  for (Index j = 0; j < kCols; ++j) {
    std::vector<T> alone(x.begin() + j * kRows, x.begin() + (j + 1) * kRows), p(kRows);
    T value = 0;
    TwoHotValue<T>(Mat<const T>(alone.data(), kRows, 1), bins, Mat<T>(p.data(), kRows, 1),
                   Mat<T>(&value, 1, 1));
    EXPECT_EQ(value, values[static_cast<std::size_t>(j)]);
    SimNorm(Mat<T>(alone.data(), kRows, 1));
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), together.begin() + j * kRows));
  }
}

}  // namespace
}  // namespace dreamsearch::networks
