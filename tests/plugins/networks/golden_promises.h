// golden_promises.h - what a learned model's updates promise about PyTorch's.
//
// A Model has kFolder, below tests/plugins, CompareUpdates<T>(case name, tolerance),
// DrawResidual(a case's input) and DeclaredSettings(), by name, without those that its golden.py
// need not know. One file of a test program instantiates them:
//   INSTANTIATE_TYPED_TEST_SUITE_P(Tdmpc, GoldenPromises, TdmpcUpdates);
#pragma once

#include <set>
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

// A parameter that was declared since would be one that golden.py does not know.
TYPED_TEST_P(GoldenPromises, CasesHaveTheDeclaredSettings) {
  const auto names = [](const Json& settings) {
    std::set<std::string> found;
    for (const auto& [name, value] : settings.items()) found.insert(name);
    return found;
  };
  for (const char* name : kGoldenCases) {
    const Json input = ReadJson(TypeParam::kFolder, std::string(name) + "_input.json");
    EXPECT_EQ(names(input.at("settings")), names(TypeParam::DeclaredSettings())) << name;
  }
}

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

REGISTER_TYPED_TEST_SUITE_P(GoldenPromises, CasesHaveTheDeclaredSettings, DrawsAreTheLearners,
                            UpdatesInFloatAgreeWithTorchToOneInAHundredThousand,
                            UpdatesInDoubleAgreeWithTorchToOneInABillion);

}  // namespace dreamsearch::networks
