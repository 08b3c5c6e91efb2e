#include "host/plugins/model_proxy.h"

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
  Status Value(ConstLatents, const ValueResult& result) noexcept override {
    ++calls;
    for (double& v : result.values) v = value;
    for (double& v : result.deviations) v = deviation;
    for (double& v : result.least) v = least;
    return status;
  }
  Status ProposeMode(ConstLatents, MatrixView<double> actions) noexcept override {
    ++calls;
    for (std::uint64_t i = 0; i < actions.size(); ++i) actions.data[i] = action;
    return status;
  }
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t>,
                        MatrixView<double> actions) noexcept override {
    return ProposeMode(latents, actions);
  }

  int calls = 0;
  double reward = 1, discount = 0.9, value = 2, deviation = 0.25, least = 1.5, action = 0.5;
  Status status;
};

class ModelProxyTest : public testing::Test {
 protected:
  Status Imagine(std::uint64_t rows, std::uint64_t rewards) { return Imagine(rows, rewards, rows); }
  Status Imagine(std::uint64_t rows, std::uint64_t rewards, std::uint64_t seeds) {
    ImagineRequest request;
    request.latents = {from_.data(), rows, 64};
    request.actions = {actions_.data(), rows, 2};
    request.seeds = {seeds_.data(), seeds};
    ImagineResult result;
    result.latents = {to_.data(), rows, 64};
    result.rewards = {rewards_.data(), rewards};
    result.discounts = {discounts_.data(), rows};
    return proxy_.Imagine(request, result);
  }

  ScriptedModel model_;
  ModelProxy proxy_{&model_, "scripted", true};
  std::vector<std::byte> from_ = std::vector<std::byte>(640), to_ = from_;
  std::vector<std::uint64_t> seeds_ = std::vector<std::uint64_t>(10);
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

TEST_F(ModelProxyTest, APlannerThatDeclaresNoSearchMayNotImagine) {
  ModelProxy proxy(&model_, "scripted", false);
  const View<const std::uint64_t> seed{seeds_.data(), 1};
  const ImagineResult result{{to_.data(), 1, 64}, {rewards_.data(), 1}, {discounts_.data(), 1}};
  EXPECT_EQ(proxy.Imagine({{from_.data(), 1, 64}, {actions_.data(), 1, 2}, seed}, result).code,
            StatusCode::kFailedPrecondition);
  EXPECT_EQ(model_.calls, 0);
  EXPECT_NE(std::string(proxy.fault().message).find("kSearches"), std::string::npos);
  EXPECT_TRUE(proxy.ProposeMode({from_.data(), 1, 64}, {actions_.data(), 1, 2}).ok());
}

TEST_F(ModelProxyTest, WrongSizesNeverReachTheModel) {
  EXPECT_EQ(Imagine(3, 2).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(Imagine(3, 3, 2).code, StatusCode::kInvalidArgument);
  const View<double> two{rewards_.data(), 2}, three{discounts_.data(), 3};
  const ConstLatents latents{from_.data(), 2, 64};
  EXPECT_EQ(proxy_.Value({from_.data(), 2, 32}, {.values = two}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Value(latents, {.values = three}).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Value(latents, {.values = two, .deviations = three}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Value(latents, {.values = two, .least = three}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.ProposeSamples(latents, {seeds_.data(), 2}, {actions_.data(), 3, 2}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.ProposeSamples(latents, {seeds_.data(), 1}, {actions_.data(), 4, 2}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(model_.calls, 0);
}

TEST_F(ModelProxyTest, EveryAnswerThatIsNotFiniteIsFoundAndNamesTheModel) {
  for (const double bad : {nan_, inf_, -inf_}) {
    ScriptedModel model;
    model.reward = bad;
    model.value = bad;
    model.action = bad;
    ModelProxy proxy(&model, "scripted", true);
    const View<const std::uint64_t> seed{seeds_.data(), 1};
    ImagineRequest request{{from_.data(), 1, 64}, {actions_.data(), 1, 2}, seed};
    const ImagineResult result{{to_.data(), 1, 64}, {rewards_.data(), 1}, {discounts_.data(), 1}};
    EXPECT_EQ(proxy.Imagine(request, result).code, StatusCode::kNotFinite);
    const ValueResult room{{rewards_.data(), 1}, {rewards_.data() + 1, 1}, {discounts_.data(), 1}};
    EXPECT_EQ(proxy.Value({from_.data(), 1, 64}, room).code, StatusCode::kNotFinite);
    model.value = 2;
    model.deviation = bad;
    EXPECT_EQ(proxy.Value({from_.data(), 1, 64}, room).code, StatusCode::kNotFinite);
    model.deviation = 0;
    model.least = bad;
    EXPECT_EQ(proxy.Value({from_.data(), 1, 64}, room).code, StatusCode::kNotFinite);
    EXPECT_EQ(proxy.ProposeMode({from_.data(), 1, 64}, {actions_.data(), 1, 2}).code,
              StatusCode::kNotFinite);
    EXPECT_EQ(proxy.ProposeSamples({from_.data(), 1, 64}, seed, {actions_.data(), 4, 2}).code,
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
