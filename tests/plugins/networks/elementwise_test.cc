// The functions that activations are made of, against the standard library's in double,
// over their whole range; NaN stays NaN.
#include "plugins/networks/elementwise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <vector>

#include "dreamsearch/random.h"
#include "plugins/networks/noise.h"

namespace dreamsearch::networks {
namespace {

void Show(const char* name, double residual) {
  if (std::getenv("DREAMSEARCH_SHOW_RESIDUALS") != nullptr) {
    std::printf("%-30s %.3g\n", name, residual);
  }
}

// Arguments from -100 to 100, denser around 0, and a number that fills no register.
template <typename T>
std::vector<T> Arguments() {
  std::vector<T> values;
  for (int i = -5003; i <= 5000; ++i) {
    const double t = i / 5000.0;
    values.push_back(static_cast<T>(100 * t * t * t));
  }
  return values;
}

// The largest error of `run` over all arguments, in units of `scale(x)`.
template <typename T>
double LargestError(const std::function<void(std::vector<T>*)>& run,
                    const std::function<double(double)>& expected,
                    const std::function<double(double)>& scale) {
  const std::vector<T> x = Arguments<T>();
  std::vector<T> y = x;
  run(&y);
  double worst = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto at = static_cast<double>(x[i]);
    const double error = std::abs(static_cast<double>(y[i]) - expected(at)) / scale(at);
    worst = std::max(worst, error);
  }
  return worst;
}

template <typename T>
class ElementwiseOf : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(ElementwiseOf, Scalars);

TYPED_TEST(ElementwiseOf, FunctionsAreExactToSomeRoundings) {
  using T = TypeParam;
  const double epsilon = static_cast<double>(std::numeric_limits<T>::epsilon());
  const auto whole = [](std::vector<T>* v) {
    return Mat<T>(v->data(), static_cast<Index>(v->size()), 1);
  };
  const auto one = [](double) { return 1.0; };

  const double elu = LargestError<T>([&](std::vector<T>* v) { Elu(whole(v)); },
                                     [](double x) { return x > 0 ? x : std::expm1(x); },
                                     [](double x) { return std::max(1.0, std::abs(x)); });
  Show("elu", elu / epsilon);
  EXPECT_LT(elu, 4 * epsilon);

  const double sigmoid = LargestError<T>([&](std::vector<T>* v) { Sigmoid<T>(whole(v), whole(v)); },
                                         [](double x) { return 1 / (1 + std::exp(-x)); }, one);
  Show("sigmoid", sigmoid / epsilon);
  EXPECT_LT(sigmoid, 4 * epsilon);

  const double atanh = LargestError<T>(
      [&](std::vector<T>* v) {
        for (T& x : *v) x = std::clamp(x / T(40), T(-0.999), T(0.999));
        Atanh(whole(v));
      },
      [](double x) {
        const double clipped =
            std::clamp(static_cast<double>(static_cast<T>(x) / T(40)),
                       static_cast<double>(T(-0.999)), static_cast<double>(T(0.999)));
        return std::atanh(clipped);
      },
      one);
  Show("atanh", atanh / epsilon);
  EXPECT_LT(atanh, 4 * epsilon);

  // std = softplus(c) + least, of an empty mean.
  const double softplus = LargestError<T>(
      [&](std::vector<T>* v) {
        const auto n = static_cast<Index>(v->size());
        std::vector<T> raw(2 * v->size()), sample(v->size());
        std::copy(v->begin(), v->end(), raw.begin() + n);
        GaussianForward<T>(Mat<T>(raw.data(), 2 * n, 1), Mat<T>(), T(0), whole(v), whole(&sample));
      },
      [](double x) { return std::max(x, 0.0) + std::log1p(std::exp(-std::abs(x))); },
      [](double x) { return std::max(1.0, std::abs(x)); });
  Show("softplus", softplus / epsilon);
  EXPECT_LT(softplus, 4 * epsilon);

  // Of the rows (x, -x), which have mean 0 and are normalised to (1, -1): scale = x brings
  // the argument back.
  const double mish = LargestError<T>(
      [&](std::vector<T>* v) {
        for (T& x : *v) {
          const T scale[] = {x, x}, shift[] = {0, 0};
          T column[] = {T(1e6), T(-1e6)}, unit[2], inverse;
          LayerNorm<T>(AfterNorm::kMish, scale, shift, Mat<T>(column, 2, 1), Mat<T>(unit, 2, 1),
                       Mat<T>(&inverse, 1, 1));
          x = column[0];
        }
      },
      [](double x) { return x * std::tanh(std::max(x, 0.0) + std::log1p(std::exp(-std::abs(x)))); },
      [](double x) { return std::max(1.0, std::abs(x)); });
  Show("mish", mish / epsilon);
  EXPECT_LT(mish, 4 * epsilon);

  // The mode of an actor with a limit of 1: tanh(tanh(m)).
  const double tanh = LargestError<T>(
      [&](std::vector<T>* v) {
        const auto n = static_cast<Index>(v->size());
        std::vector<T> raw(2 * v->size()), squashed(v->size()), std(v->size());
        std::copy(v->begin(), v->end(), raw.begin());
        ActorForward<T>(Mat<T>(raw.data(), 2 * n, 1), Mat<T>(), {.mean_limit = 1}, whole(&squashed),
                        whole(&std), whole(v), Mat<T>());
      },
      [](double x) { return std::tanh(std::tanh(x)); }, one);
  Show("tanh of tanh", tanh / epsilon);
  EXPECT_LT(tanh, 8 * epsilon);
}

TYPED_TEST(ElementwiseOf, NanStaysNan) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN();
  for (const Index size : {1, 7, 16, 33}) {
    const auto n = static_cast<std::size_t>(size);
    const std::vector<T> bad(4 * n, nan), good(4 * n, T(0.5));
    const auto all_nan = [&](const std::vector<T>& values, std::size_t count) {
      return std::all_of(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count),
                         [](T v) { return std::isnan(v); });
    };
    std::vector<T> y = bad;
    Elu(Mat<T>(y.data(), size, 1));
    EXPECT_TRUE(all_nan(y, n)) << "elu, " << size;
    y = bad;
    Sigmoid<T>(Mat<T>(y.data(), size, 1), Mat<T>(y.data(), size, 1));
    EXPECT_TRUE(all_nan(y, n)) << "sigmoid, " << size;
    std::vector<T> std(n), sample(n);
    const Mat<T> std_view(std.data(), size, 1), sample_view(sample.data(), size, 1);
    GaussianForward<T>(Mat<const T>(bad.data(), 2 * size, 1), Mat<const T>(good.data(), size, 1),
                       T(0.1), std_view, sample_view);
    EXPECT_TRUE(all_nan(std, n) && all_nan(sample, n)) << "gaussian, " << size;
    std::vector<T> gates(4 * n), next(n);
    GruForward<T>(Mat<const T>(bad.data(), 3 * size, 1), Mat<const T>(good.data(), 3 * size, 1),
                  Mat<const T>(good.data(), size, 1), Mat<T>(gates.data(), 4 * size, 1),
                  Mat<T>(next.data(), size, 1));
    EXPECT_TRUE(all_nan(next, n) && all_nan(gates, 3 * n)) << "gru, " << size;
    std::vector<T> squashed(n), action(n), entropy(1);
    ActorForward<T>(Mat<const T>(bad.data(), 2 * size, 1), Mat<const T>(good.data(), size, 1), {},
                    Mat<T>(squashed.data(), size, 1), std_view, Mat<T>(action.data(), size, 1),
                    Mat<T>(entropy.data(), 1, 1));
    EXPECT_TRUE(all_nan(action, n) && all_nan(entropy, 1)) << "actor, " << size;
    std::vector<T> unit(n), inverse(1);
    for (const AfterNorm after : {AfterNorm::kNothing, AfterNorm::kElu, AfterNorm::kMish}) {
      y = bad;
      LayerNorm<T>(after, good.data(), good.data(), Mat<T>(y.data(), size, 1),
                   Mat<T>(unit.data(), size, 1), Mat<T>(inverse.data(), 1, 1));
      EXPECT_TRUE(all_nan(y, n)) << "layer norm, " << size;
    }
    std::vector<T> kl(1);
    GaussianKl<T>(Mat<const T>(bad.data(), 2 * size, 1), Mat<const T>(good.data(), size, 1),
                  Mat<const T>(good.data(), 2 * size, 1), Mat<const T>(good.data(), size, 1),
                  Mat<T>(kl.data(), 1, 1));
    EXPECT_TRUE(all_nan(kl, 1)) << "kl, " << size;
  }
}

TEST(Noise, IsNormal) {
  constexpr Index kCount = 200001;
  std::vector<float> draws(kCount);
  FillNormal(5, draws.data(), kCount);
  double moments[5] = {};
  for (const float x : draws) {
    double power = 1;
    for (double& moment : moments) {
      moment += power / kCount;
      power *= static_cast<double>(x);
    }
  }
  // Standard errors of the means of x, x^2, x^3, x^4: sqrt(1, 2, 15, 96) / sqrt(n); five
  // of them.
  const double error = 5 / std::sqrt(static_cast<double>(kCount));
  EXPECT_NEAR(moments[1], 0, error);
  EXPECT_NEAR(moments[2], 1, error * std::sqrt(2.0));
  EXPECT_NEAR(moments[3], 0, error * std::sqrt(15.0));
  EXPECT_NEAR(moments[4], 3, error * std::sqrt(96.0));
}

TEST(Noise, DrawsAreAFunctionOfSeedAndIndex) {
  std::vector<float> all(500), some(500);
  FillNormal(9, all.data(), 500);
  for (const Index count : {1, 2, 31, 127, 128, 129, 300}) {
    FillNormal(9, some.data(), count);
    EXPECT_TRUE(std::equal(some.begin(), some.begin() + count, all.begin())) << count;
  }
}

}  // namespace
}  // namespace dreamsearch::networks
