// golden_promises.h - what a learned model's updates promise about PyTorch's.
//
// A Model has kFolder, below tests/plugins, CompareUpdates<T>(case name, tolerance) and
// DrawResidual(a case's input). One file of a test program instantiates them:
//   INSTANTIATE_TYPED_TEST_SUITE_P(Tdmpc, GoldenPromises, TdmpcUpdates);
#pragma once

#include <string>

#include "tests/plugins/networks/golden_tools.h"

namespace dreamsearch::networks {

template <typename Model>
class GoldenPromises : public testing::Test {
 protected:
  static double DrawResidual(const std::string& name) {
    return Model::DrawResidual(ReadJson(Model::kFolder, name + "_input.json"));
  }
};
TYPED_TEST_SUITE_P(GoldenPromises);

// Six ulp of a draw between 4 and 8.
TYPED_TEST_P(GoldenPromises, DrawsAreTheLearners) {
  for (const char* name : kGoldenCases) EXPECT_LT(this->DrawResidual(name), 3e-6) << name;
}

TYPED_TEST_P(GoldenPromises, UpdatesInFloatAgreeWithTorchToOneInAHundredThousand) {
  for (const char* name : kGoldenCases) TypeParam::template CompareUpdates<float>(name, 1e-5);
}

// Where the draws differ by a rounding, ten times that is allowed on top.
TYPED_TEST_P(GoldenPromises, UpdatesInDoubleAgreeWithTorchToOneInABillion) {
  for (const char* name : kGoldenCases) {
    TypeParam::template CompareUpdates<double>(name, 1e-9 + 10 * this->DrawResidual(name));
  }
}

REGISTER_TYPED_TEST_SUITE_P(GoldenPromises, DrawsAreTheLearners,
                            UpdatesInFloatAgreeWithTorchToOneInAHundredThousand,
                            UpdatesInDoubleAgreeWithTorchToOneInABillion);

}  // namespace dreamsearch::networks
