// broken_planners.cc - a shooting planner with a memory, and what can be wrong with one.
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "dreamsearch/planning.h"
#include "tests/sdk/check/broken.h"

namespace dreamsearch::check {
namespace {

enum class Fault {
  kNone,
  kNoHelp,
  kRefusesItsDefaults,
  kChangesFolder,
  kDiesAtMost,
  kFixedSize,
  kGrows,
  kPlansWithoutAnEpisode,
  kTakesAnySize,
  kLeavesAMetric,
  kBeyondItsRange,
  kWritesPastTheAction,
  kWritesToTheRoot,
  kRemembersEpisodes,
  kSharesState,
  kForgetsOnSave,
  kTakesCutBytes,
  kAllocates,
  kSwallowsErrors,
  kBelievesNan,
  kDrawsForTheTree,
  kSearchesInSecret,
  kWrongWeights,
  kHidesItsPolicy,
  kImaginesInPlace,
  kCrashes,
  kExits,
  kHangs,
  kHoards,
};

constexpr MetricSpec kMetrics[] = {{"best", "", "the best return"}, {"tried", "", "how many"}};
constexpr std::uint64_t kTried = 6;

struct Tries {
  std::uint64_t tries;
};
constexpr auto kTries = BindSettings<Tries>(
    Bind<&Tries::tries>(IntParameter("tries", 3, 1, 100, "", "How many tries.")));

double shared_drift = 0;               // of Fault::kSharesState
std::vector<std::vector<char>> hoard;  // of faults that fill memory

template <Fault kFault>
class Shooting final : public Offers<Planner, TreeReporting, PolicyReporting> {
 public:
  explicit Shooting(const PlannerContext& context)
      : sizes_{context.action_size, context.latent_bytes, 2},
        most_(kTries.Read(context.parameters).tries == 100),
        roots_(kTried, context.latent_bytes),
        next_(kTried, context.latent_bytes),
        actions_(kTried * context.action_size),
        rewards_(kTried),
        discounts_(kTried),
        values_(kTried),
        seeds_(kTried) {
    if (kFault == Fault::kRefusesItsDefaults) throw std::invalid_argument("tries must be 3");
    if (kFault == Fault::kFixedSize && context.action_size > 8) {
      throw std::invalid_argument("more than 8 action components");
    }
  }

  Status BeginEpisode(LatentModel* model) noexcept override {
    if (Status status = CheckModel(sizes_, model); !status.ok()) return status;
    if (kFault == Fault::kGrows) hoard.emplace_back(1 << 20, 'x');
    model_ = model;
    if (kFault != Fault::kRemembersEpisodes) drift() = 0;
    return OkStatus();
  }

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    if (kFault == Fault::kPlansWithoutAnEpisode && model_ == nullptr) return OkStatus();
    if (kFault != Fault::kTakesAnySize || model_ == nullptr || result == nullptr) {
      if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    }
    if (kFault == Fault::kDiesAtMost && most_) ::raise(SIGSEGV);
    if (kFault == Fault::kCrashes && request.decision == 1) ::raise(SIGSEGV);
    if (kFault == Fault::kExits) std::_Exit(3);
    if (kFault == Fault::kHangs) ::pause();
    if (kFault == Fault::kHoards) {
      for (;;) hoard.emplace_back(1 << 20, 'x');
    }
    if (kFault == Fault::kChangesFolder) std::filesystem::current_path("/");
    if (kFault == Fault::kAllocates) hoard.assign(1, std::vector<char>(100));
    Status status = Search(request, result);
    if (kFault == Fault::kSwallowsErrors && !status.ok()) status = OkStatus();
    return status;
  }

  Status Save(ByteSink* sink) const noexcept override {
    return WriteValue(sink, kFault == Fault::kForgetsOnSave ? 0.5 : drift());
  }
  Status Load(ByteSource* source) noexcept override {
    const Status status = ReadValue(source, &drift());
    return kFault == Fault::kTakesCutBytes ? OkStatus() : status;
  }
  void ReportTree(TreeSink*) noexcept override { reported_ = true; }
  Status ReportPolicy(MatrixView<double> actions, View<double> weights) noexcept override {
    if (actions.cols != sizes_.action_size || actions.rows != weights.size) {
      return Error(StatusCode::kInvalidArgument, "room for other actions");
    }
    std::fill_n(actions.data, actions.size(), 0.0);
    for (std::uint64_t k = 0; k < weights.size; ++k) {
      weights[k] = kFault == Fault::kWrongWeights ? 1 : k == 0 ? 1 : 0;
    }
    return OkStatus();
  }
  void* Extension(const char* name) noexcept override {
    if (kFault == Fault::kHidesItsPolicy && std::strcmp(name, PolicyReporting::kName) == 0) {
      return nullptr;
    }
    return Offers::Extension(name);
  }
  void Destroy() noexcept override { delete this; }

 private:
  ~Shooting() = default;

  double& drift() { return kFault == Fault::kSharesState ? shared_drift : drift_; }
  double drift() const { return kFault == Fault::kSharesState ? shared_drift : drift_; }

  Status Search(const PlanRequest& request, PlanResult* result) noexcept {
    const std::uint64_t a = sizes_.action_size;
    Random random(request.seed);
    if (kFault == Fault::kDrawsForTheTree && reported_) random.Next();
    for (double& x : actions_) x = std::clamp(random.Uniform(-1, 1) + 0.1 * drift(), -1.0, 1.0);
    FillSeeds(request.seed, {seeds_.data(), kTried});
    for (std::uint64_t i = 0; i < kTried; ++i) roots_.Set(i, request.root);
    ImagineRequest imagine;
    imagine.latents = roots_.middle_rows(0, kTried);
    imagine.actions = {actions_.data(), kTried, a};
    imagine.seeds = {seeds_.data(), kTried};
    ImagineResult imagined;
    imagined.latents = kFault == Fault::kImaginesInPlace ? roots_.middle_rows(0, kTried)
                                                         : next_.middle_rows(0, kTried);
    imagined.rewards = {rewards_.data(), kTried};
    imagined.discounts = {discounts_.data(), kTried};
    if (Status status = model_->Imagine(imagine, imagined); !status.ok()) return status;
    if (Status status = model_->Value(imagined.latents, {values_.data(), kTried}); !status.ok()) {
      return status;
    }
    std::uint64_t best = 0;
    for (std::uint64_t i = 0; i < kTried; ++i) {
      values_[i] = rewards_[i] + discounts_[i] * values_[i];
      if (values_[i] > values_[best]) best = i;
    }
    if (kFault != Fault::kBelievesNan) {
      if (Status status = CheckFinite("return", {values_.data(), kTried}); !status.ok()) {
        return status;
      }
    }
    for (std::uint64_t j = 0; j < a; ++j) result->action[j] = actions_[best * a + j];
    drift() = 0.5 * drift() + result->action[0];
    result->metrics[0] = values_[best];
    if (kFault != Fault::kLeavesAMetric) result->metrics[1] = kTried;
    if (kFault == Fault::kBeyondItsRange)
      result->action[a - 1] *= 1.5 / std::abs(result->action[a - 1]);
    if (kFault == Fault::kWritesPastTheAction) result->action.data[a] = 0;
    if (kFault == Fault::kWritesToTheRoot)
      const_cast<std::byte&>(request.root.data[3]) ^= std::byte{1};
    result->value = values_[best];
    return OkStatus();
  }

  const PlannerSizes sizes_;
  const bool most_;
  LatentModel* model_ = nullptr;
  LatentBuffer roots_, next_;
  std::vector<double> actions_, rewards_, discounts_, values_;
  std::vector<std::uint64_t> seeds_;
  double drift_ = 0;
  bool reported_ = false;
};

constexpr ParameterSpec kHelpless[] = {IntParameter("tries", 3, 1, 100, "", "")};

template <Fault kFault>
const ComponentDescriptor* Component(std::uint32_t traits = kSearches | kReportsPolicy) {
  static const ComponentDescriptor component = [traits] {
    ComponentDescriptor made;
    made.kind = ComponentKind::kPlanner;
    made.traits = traits;
    made.name = "broken_planner";
    made.version = "1.0.0";
    made.summary = "right but for one thing";
    made.parameters =
        kFault == Fault::kNoHelp ? Records<ParameterSpec>(ViewOf(kHelpless)) : kTries.declared();
    made.metrics = ViewOf(kMetrics);
    made.create_planner = CreatePlanner<Shooting<kFault>>;
    return made;
  }();
  return &component;
}

}  // namespace

std::vector<BrokenComponent> BrokenPlanners() {
  constexpr auto kExtremes = Level::kExtremes;
  return {
      {Component<Fault::kNone>(), "", "", kExtremes},
      {Component<Fault::kNoHelp>(), "C2", "\"\"", kExtremes},
      {Component<Fault::kRefusesItsDefaults>(), "C3", "tries must be 3", kExtremes},
      {Component<Fault::kChangesFolder>(), "C4", "/", kExtremes},
      {Component<Fault::kDiesAtMost>(), "C5", "signal 11", kExtremes, Verdict::kCrashed},
      {Component<Fault::kFixedSize>(), "C6", "more than 8 action components", kExtremes},
      {Component<Fault::kGrows>(), "C7", "MiB more", Level::kSoak},
      {Component<Fault::kPlansWithoutAnEpisode>(), "P1", "success", kExtremes},
      {Component<Fault::kTakesAnySize>(), "P2", "success", kExtremes},
      {Component<Fault::kLeavesAMetric>(), "P3", "value 1 of 2 is NaN, or was not set"},
      {Component<Fault::kBeyondItsRange>(), "P3", "value 1 is"},
      {Component<Fault::kWritesPastTheAction>(), "P3", "a write 16 bytes from its beginning"},
      {Component<Fault::kWritesToTheRoot>(), "P3", "bytes written to it"},
      {Component<Fault::kRemembersEpisodes>(), "P4", "", kExtremes},
      {Component<Fault::kSharesState>(), "P5", "", kExtremes},
      {Component<Fault::kForgetsOnSave>(), "P6", "", kExtremes},
      {Component<Fault::kTakesCutBytes>(), "P7", "success", kExtremes},
      {Component<Fault::kAllocates>(), "P8", " in call 2", kExtremes},
      {Component<Fault::kSwallowsErrors>(), "P9", "success"},
      {Component<Fault::kBelievesNan>(), "P10", "", kExtremes},
      {Component<Fault::kDrawsForTheTree>(), "P11", "", kExtremes},
      {Component<Fault::kSearchesInSecret>(kReportsPolicy), "P12", "transitions", kExtremes},
      {Component<Fault::kWrongWeights>(), "P12", "2"},
      {Component<Fault::kHidesItsPolicy>(), "P12", "none", kExtremes},
      {Component<Fault::kImaginesInPlace>(), "P13", "a latent imagined in place", kExtremes},
  };
}

std::vector<BrokenComponent> DyingPlanners() {
  return {{Component<Fault::kCrashes>(), "C3", "signal 11 (Segmentation fault) in Plan, decision 1",
           Level::kMake, Verdict::kCrashed},
          {Component<Fault::kExits>(), "C3", "ended with status 3 in Plan, decision 0",
           Level::kMake, Verdict::kCrashed},
          {Component<Fault::kHangs>(), "C3", "no end after 0.5 s in Plan, decision 0", Level::kMake,
           Verdict::kTimedOut},
          {Component<Fault::kHoards>(), "C3", "more than 64 MiB in Plan, decision 0", Level::kMake,
           Verdict::kTooLarge}};
}

}  // namespace dreamsearch::check
