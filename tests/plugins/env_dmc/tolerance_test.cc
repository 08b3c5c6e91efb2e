#include "plugins/mujoco/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "tests/plugins/env_dmc/reference_data.h"

namespace dreamsearch::dmc {
namespace {

TEST(Tolerance, EqualsTheRecordedValues) {
  const std::map<std::string, Falloff> falloffs = {
      {"gaussian", Falloff::kGaussian},   {"hyperbolic", Falloff::kHyperbolic},
      {"long_tail", Falloff::kLongTail},  {"reciprocal", Falloff::kReciprocal},
      {"cosine", Falloff::kCosine},       {"linear", Falloff::kLinear},
      {"quadratic", Falloff::kQuadratic}, {"tanh_squared", Falloff::kTanhSquared},
  };
  const Json reference = ReadJson(ReferenceFile("tolerance.json"));
  std::set<std::string> seen;
  for (const Json& row : reference.at("rows")) {
    const double high = row.at("upper").is_null() ? std::numeric_limits<double>::infinity()
                                                  : row.at("upper").get<double>();
    const Tolerance tolerance(row.at("lower"), high, row.at("margin"),
                              falloffs.at(row.at("sigmoid")), row.at("value_at_margin"));
    EXPECT_NEAR(tolerance(row.at("x")), row.at("value").get<double>(), 1e-15) << row;
    seen.insert(row.at("sigmoid"));
  }
  EXPECT_EQ(seen.size(), falloffs.size());
}

TEST(Tolerance, TakesTheGivenValueOneMarginAway) {
  for (int falloff = 0; falloff <= static_cast<int>(Falloff::kTanhSquared); ++falloff) {
    const Tolerance tolerance(-1, 2, 3, static_cast<Falloff>(falloff), 0.25);
    EXPECT_NEAR(tolerance(5), 0.25, 1e-15) << falloff;
    EXPECT_NEAR(tolerance(-4), 0.25, 1e-15) << falloff;
    EXPECT_EQ(tolerance(-1), 1);
    EXPECT_EQ(tolerance(2), 1);
  }
}

TEST(Tolerance, WithoutAMarginIsAnIndicator) {
  const Tolerance tolerance(0, 1);
  EXPECT_EQ(tolerance(0), 1);
  EXPECT_EQ(tolerance(1), 1);
  EXPECT_EQ(tolerance(1 + 1e-16), 1);  // which is 1
  EXPECT_EQ(tolerance(1 + 3e-16), 0);
  EXPECT_EQ(tolerance(-1e-300), 0);
}

TEST(Tolerance, TheGaussianReachesZeroWhereTheExponentialDoes) {
  const Tolerance tolerance(0, 0, 1, Falloff::kGaussian, std::exp(-0.5));  // exp(-x^2 / 2)
  for (double x = 37; x < 40; x += 0.001) {
    ASSERT_NEAR(tolerance(x), std::exp(-0.5 * (x * x)), 1e-315) << x;
    ASSERT_EQ(tolerance(x) == 0, std::exp(-0.5 * (x * x)) == 0) << x;
  }
}

TEST(Tolerance, RefusesWhatMakesNoSense) {
  EXPECT_THROW(Tolerance(1, 0), std::invalid_argument);
  EXPECT_THROW(Tolerance(0, 1, -1), std::invalid_argument);
  EXPECT_THROW(Tolerance(0, 1, 1, Falloff::kGaussian, 0), std::invalid_argument);
  EXPECT_THROW(Tolerance(0, 1, 1, Falloff::kLinear, 1), std::invalid_argument);
  EXPECT_NO_THROW(Tolerance(0, 1, 1, Falloff::kLinear, 0));
}

}  // namespace
}  // namespace dreamsearch::dmc
