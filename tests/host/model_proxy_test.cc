#include "host/model_proxy.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

namespace dreamsearch {
namespace {

// Answers with whatever the test put in.
class ScriptedModel final : public LatentModel {
 public:
  std::uint64_t latent_bytes() const noexcept override { return 64; }
  std::uint64_t action_size() const noexcept override { return 2; }
  Status Imagine(const ImagineRequest&, const ImagineResult& result) noexcept override {
    ++calls;
    for (double& r : result.rewards) r = reward;
    for (double& d : result.discounts) d = discount;
    return status;
  }
  Status Value(ConstLatents, View<double> values) noexcept override {
    ++calls;
    for (double& v : values) v = value;
    return status;
  }
  Status ProposeMode(ConstLatents, MatrixView<double> actions) noexcept override {
    ++calls;
    for (std::uint64_t i = 0; i < actions.size(); ++i) actions.data[i] = action;
    return status;
  }
  Status ProposeSamples(ConstLatents latents, std::uint64_t,
                        MatrixView<double> actions) noexcept override {
    return ProposeMode(latents, actions);
  }

  int calls = 0;
  double reward = 1, discount = 0.9, value = 2, action = 0.5;
  Status status;
};

class ModelProxyTest : public testing::Test {
 protected:
  Status Imagine(std::uint64_t rows, std::uint64_t rewards) {
    ImagineRequest request;
    request.latents = {from_.data(), rows, 64};
    request.actions = {actions_.data(), rows, 2};
    ImagineResult result;
    result.latents = {to_.data(), rows, 64};
    result.rewards = {rewards_.data(), rewards};
    result.discounts = {discounts_.data(), rows};
    return proxy_.Imagine(request, result);
  }

  ScriptedModel model_;
  ModelProxy proxy_{&model_, "scripted"};
  std::vector<std::byte> from_ = std::vector<std::byte>(640), to_ = from_;
  std::vector<double> actions_ = std::vector<double>(20), rewards_ = actions_,
                      discounts_ = actions_;
  const double nan_ = std::numeric_limits<double>::quiet_NaN();
  const double inf_ = std::numeric_limits<double>::infinity();
};

TEST_F(ModelProxyTest, CountsOneTransitionARow) {
  EXPECT_TRUE(Imagine(3, 3).ok());
  EXPECT_TRUE(Imagine(10, 10).ok());
  EXPECT_EQ(proxy_.transitions(), 13u);
  EXPECT_TRUE(proxy_.fault().ok());
}

TEST_F(ModelProxyTest, WrongSizesNeverReachTheModel) {
  EXPECT_EQ(Imagine(3, 2).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Value({from_.data(), 2, 32}, {rewards_.data(), 2}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.ProposeSamples({from_.data(), 2, 64}, 0, {actions_.data(), 3, 2}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(model_.calls, 0);
}

TEST_F(ModelProxyTest, EveryAnswerThatIsNotFiniteIsFoundAndNamesTheModel) {
  for (const double bad : {nan_, inf_, -inf_}) {
    ScriptedModel model;
    model.reward = bad;
    model.value = bad;
    model.action = bad;
    ModelProxy proxy(&model, "scripted");
    ImagineRequest request{{from_.data(), 1, 64}, {actions_.data(), 1, 2}, 0};
    const ImagineResult result{{to_.data(), 1, 64}, {rewards_.data(), 1}, {discounts_.data(), 1}};
    EXPECT_EQ(proxy.Imagine(request, result).code, StatusCode::kNotFinite);
    EXPECT_EQ(proxy.Value({from_.data(), 1, 64}, {rewards_.data(), 1}).code,
              StatusCode::kNotFinite);
    EXPECT_EQ(proxy.ProposeMode({from_.data(), 1, 64}, {actions_.data(), 1, 2}).code,
              StatusCode::kNotFinite);
    EXPECT_EQ(proxy.ProposeSamples({from_.data(), 1, 64}, 0, {actions_.data(), 4, 2}).code,
              StatusCode::kNotFinite);
    EXPECT_NE(std::string(proxy.fault().message).find("'scripted'"), std::string::npos);
    model.reward = 0;
    model.discount = bad;
    EXPECT_EQ(proxy.Imagine(request, result).code, StatusCode::kNotFinite);
  }
}

TEST_F(ModelProxyTest, AnActionThatIsNotFiniteNeverReachesTheModel) {
  actions_[1] = nan_;
  EXPECT_EQ(Imagine(1, 1).code, StatusCode::kNotFinite);
  EXPECT_EQ(model_.calls, 0);
}

TEST_F(ModelProxyTest, TheFirstFaultIsKept) {
  model_.status = Error(StatusCode::kInternal, "first");
  EXPECT_EQ(Imagine(1, 1).code, StatusCode::kInternal);
  model_.status = OkStatus();
  EXPECT_TRUE(Imagine(1, 1).ok());
  EXPECT_EQ(proxy_.fault().code, StatusCode::kInternal);
}

}  // namespace
}  // namespace dreamsearch
