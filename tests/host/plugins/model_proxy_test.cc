#include "host/plugins/model_proxy.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <string>
#include <vector>

namespace dreamsearch {
namespace {

// Answers with whatever the test put in.
class ScriptedModel final : public Offers<LatentModel, ValueSpread, ReturnGradient> {
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
  Status Gradient(const GradientRequest&, const GradientResult& result) noexcept override {
    ++calls;
    for (double& v : result.returns) v = value;
    for (std::uint64_t i = 0; i < result.gradients.size(); ++i) result.gradients.data[i] = slope;
    return status;
  }
  Status Spread(ConstLatents, const SpreadResult& result) noexcept override {
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
  double reward = 1, discount = 0.9, value = 2, deviation = 0.25, least = 1.5, action = 0.5,
         slope = 3;
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
  EXPECT_EQ(proxy_.Value({from_.data(), 2, 32}, two).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Value(latents, three).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Spread(latents, {.values = three}).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Spread(latents, {.values = two, .deviations = three}).code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(proxy_.Spread(latents, {.values = two, .least = three}).code,
            StatusCode::kInvalidArgument);
  const MatrixView<double> slopes{rewards_.data(), 4, 2};
  const auto gradient = [&](std::uint64_t steps, std::uint64_t seeds, MatrixView<double> room) {
    return proxy_.Gradient({latents, {actions_.data(), steps, 2}, {seeds_.data(), seeds}},
                           {two, room});
  };
  EXPECT_EQ(gradient(3, 3, slopes).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(gradient(4, 3, slopes).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(gradient(4, 4, slopes.middle_rows(0, 3)).code, StatusCode::kInvalidArgument);
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
    const ConstLatents from{from_.data(), 1, 64};
    const GradientRequest sequence{from, {actions_.data(), 2, 2}, {seeds_.data(), 2}};
    const GradientResult slopes{{discounts_.data(), 1}, {rewards_.data(), 2, 2}};
    actions_[0] = 0;
    const SpreadResult room{{rewards_.data(), 1}, {rewards_.data() + 1, 1}, {discounts_.data(), 1}};
    EXPECT_EQ(proxy.Value(from, {rewards_.data(), 1}).code, StatusCode::kNotFinite);
    EXPECT_EQ(proxy.Spread(from, room).code, StatusCode::kNotFinite);
    EXPECT_EQ(proxy.Gradient(sequence, slopes).code, StatusCode::kNotFinite);
    model.value = 2;
    model.slope = bad;
    EXPECT_EQ(proxy.Gradient(sequence, slopes).code, StatusCode::kNotFinite);
    model.deviation = bad;
    EXPECT_EQ(proxy.Spread(from, room).code, StatusCode::kNotFinite);
    model.deviation = 0;
    model.least = bad;
    EXPECT_EQ(proxy.Spread(from, room).code, StatusCode::kNotFinite);
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

TEST_F(ModelProxyTest, OffersOfTheModelsExtensionsThoseThatItChecks) {
  class Bare final : public LatentModel {
   public:
    std::uint64_t latent_bytes() const noexcept override { return 64; }
    std::uint64_t action_size() const noexcept override { return 2; }
    Status Imagine(const ImagineRequest&, const ImagineResult&) noexcept override { return {}; }
    Status Value(ConstLatents, View<double>) noexcept override { return {}; }
    Status ProposeMode(ConstLatents, MatrixView<double>) noexcept override { return {}; }
    Status ProposeSamples(ConstLatents, View<const std::uint64_t>,
                          MatrixView<double>) noexcept override {
      return {};
    }
    void* Extension(const char* name) noexcept override {
      return std::strcmp(name, "stranger.secret/1") == 0 ? this : nullptr;
    }
  } bare;
  ModelProxy proxy(&bare, "bare", true);
  EXPECT_NE(bare.Extension("stranger.secret/1"), nullptr);
  EXPECT_EQ(proxy.Extension("stranger.secret/1"), nullptr);
  EXPECT_EQ(ExtensionOf<ValueSpread>(&proxy), nullptr);
  EXPECT_EQ(ExtensionOf<ReturnGradient>(&proxy), nullptr);
  EXPECT_EQ(ExtensionOf<ValueSpread>(&proxy_), &proxy_);
  EXPECT_EQ(ExtensionOf<ReturnGradient>(&proxy_), &proxy_);
}

TEST_F(ModelProxyTest, CountsTheTransitionsOfGradientsAndRefusesThemToWhoDoesNotSearch) {
  const ConstLatents from{from_.data(), 2, 64};
  const GradientRequest request{from, {actions_.data(), 6, 2}, {seeds_.data(), 6}};
  const GradientResult result{{discounts_.data(), 2}, {rewards_.data(), 6, 2}};
  EXPECT_TRUE(proxy_.Gradient(request, result).ok());
  EXPECT_EQ(proxy_.transitions(), 6u);
  ModelProxy idle(&model_, "scripted", false);
  EXPECT_EQ(idle.Gradient(request, result).code, StatusCode::kFailedPrecondition);
  EXPECT_EQ(model_.calls, 1);
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
