// faulty.cc - components that fail on request, to test that the host contains it. Over 400 lines:
// one small component after the other.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "dreamsearch/plugin.h"

namespace dreamsearch {
namespace {

// Not inlined, so that the compiler does not see a throw in a noexcept function.
[[gnu::noinline]] void Throw() { throw std::runtime_error("thrown on purpose"); }

// A signal also where UBSan would end the process before.
[[gnu::noinline, gnu::no_sanitize("null")]] void WriteToNull() {
  volatile int* const volatile null = nullptr;
  *null = 1;
}

// Until a signal handler has run; says so in the run's log first.
[[gnu::noinline]] void AwaitSignal() {
  std::fputs("waiting\n", stderr);
  ::pause();
}

enum class Fault {
  kNan,
  kOutside,
  kThrow,
  kSegfault,
  kExit,
  kQuit,
  kHang,
  kSleep,
  kSegfaultAtStop,
  kMemory,
  kUnsetValue,
  kWritesBeside
};

template <Fault kFault>
class FaultyPlanner final : public Planner {
 public:
  Status BeginEpisode(LatentModel*) noexcept override { return OkStatus(); }
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    for (double& entry : result->action) entry = 0;
    result->value = 0;
    if (request.environment_step < 1500) return OkStatus();
    switch (kFault) {
      case Fault::kNan:
        result->action[0] = std::numeric_limits<double>::quiet_NaN();
        break;
      case Fault::kOutside:
        result->action[0] = 1.5;
        break;
      case Fault::kUnsetValue:
        result->value = std::numeric_limits<double>::quiet_NaN();  // as it came
        break;
      case Fault::kWritesBeside:
        result->action.data[result->action.size] = 0;
        break;
      case Fault::kThrow:
        Throw();
        break;
      case Fault::kSegfault:
        WriteToNull();
        break;
      case Fault::kExit:
        std::_Exit(0);  // without exit handlers
      case Fault::kQuit:
        std::exit(3);
      case Fault::kHang: {
        volatile bool forever = true;
        while (forever) {
        }
        break;
      }
      case Fault::kMemory:
        for (;;) {
          hoard_.emplace_back(16 << 20, 'x');
          ::usleep(1000);
        }
      case Fault::kSleep:
        for (;;) AwaitSignal();
      case Fault::kSegfaultAtStop:
        AwaitSignal();
        WriteToNull();
        break;
    }
    return OkStatus();
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  std::vector<std::vector<char>> hoard_;
};

template <Fault kFault>
Status MakePlanner(const PlannerContext&, Planner** result) noexcept {
  *result = new FaultyPlanner<kFault>;
  return OkStatus();
}

Status MakeNull(const PlannerContext&, Planner** result) noexcept {
  *result = nullptr;
  return OkStatus();
}

Status MakeUnmakeable(const PlannerContext&, Planner** result) noexcept {
  WriteToNull();
  return MakePlanner<Fault::kNan>({}, result);
}

// Takes its time: 0.2 s of the processor's for every decision.
class SlowPlanner final : public Planner {
 public:
  Status BeginEpisode(LatentModel*) noexcept override { return OkStatus(); }
  Status Plan(const PlanRequest&, PlanResult* result) noexcept override {
    for (double& entry : result->action) entry = 0;
    result->value = 0;
    const std::clock_t end = std::clock() + CLOCKS_PER_SEC / 5;
    while (std::clock() < end) {
    }
    return OkStatus();
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }
};

Status MakeSlow(const PlannerContext&, Planner** result) noexcept {
  *result = new SlowPlanner;
  return OkStatus();
}

// Nothing is wrong with it: plays half of the actor's mode action, without search.
class HalfActor final : public Planner {
 public:
  Status BeginEpisode(LatentModel* model) noexcept override {
    model_ = model;
    return OkStatus();
  }
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    const Status status =
        model_->ProposeMode(request.root, {result->action.data, 1, result->action.size});
    for (double& entry : result->action) entry /= 2;
    result->value = 0;
    return status;
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  LatentModel* model_ = nullptr;
};

Status MakeHalfActor(const PlannerContext&, Planner** result) noexcept {
  *result = new HalfActor;
  return OkStatus();
}

// Looks ahead and does not declare it.
class SecretSearch final : public Planner {
 public:
  explicit SecretSearch(const PlannerContext& context)
      : latent_bytes_(context.latent_bytes), memory_(latent_bytes_ + kLatentAlignment) {}
  Status BeginEpisode(LatentModel* model) noexcept override {
    model_ = model;
    return OkStatus();
  }
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    for (double& entry : result->action) entry = 0;
    void* memory = memory_.data();
    std::size_t space = memory_.size();
    auto* latent =
        static_cast<std::byte*>(std::align(kLatentAlignment, latent_bytes_, memory, space));
    double reward = 0, discount = 0;
    ImagineRequest imagine;
    imagine.latents = request.root;
    imagine.actions = {result->action.data, 1, result->action.size};
    imagine.seeds = {&request.seed, 1};
    const Status status =
        model_->Imagine(imagine, {{latent, 1, latent_bytes_}, {&reward, 1}, {&discount, 1}});
    result->value = reward;
    return status.ok() ? status : OkStatus();  // it keeps the refusal to itself
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  std::uint64_t latent_bytes_;
  std::vector<std::byte> memory_;
  LatentModel* model_ = nullptr;
};

Status MakeSecretSearch(const PlannerContext& context, Planner** result) noexcept {
  *result = new SecretSearch(context);
  return OkStatus();
}

// Latents of any size; learns nothing.
template <std::uint64_t kLatentBytes>
class IdleModel : public Model {
 public:
  explicit IdleModel(std::uint64_t actions) : actions_(actions) {}
  std::uint64_t latent_bytes() const noexcept override { return kLatentBytes; }
  std::uint64_t action_size() const noexcept override { return actions_; }
  Status Imagine(const ImagineRequest&, const ImagineResult&) noexcept override {
    return Error(StatusCode::kUnimplemented, "not imagined");
  }
  Status Value(ConstLatents, View<double> values) noexcept override {
    std::fill(values.begin(), values.end(), 0.0);
    return OkStatus();
  }
  Status ProposeMode(ConstLatents, MatrixView<double> actions) noexcept override {
    std::memset(actions.data, 0, actions.size() * sizeof(double));
    return OkStatus();
  }
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t>,
                        MatrixView<double> actions) noexcept override {
    return ProposeMode(latents, actions);
  }
  Status InitialLatent(Latents latents) noexcept override {
    std::memset(latents.data, 0, latents.size());
    return OkStatus();
  }
  Status Observe(const ObserveRequest&, Latents latents) noexcept override {
    return InitialLatent(latents);
  }
  Status Train(const TrainRequest&, View<double>) noexcept override {
    return Error(StatusCode::kUnimplemented, "nothing to learn");
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 protected:
  virtual ~IdleModel() = default;

 private:
  std::uint64_t actions_;
};

template <std::uint64_t kLatentBytes>
Status MakeIdleModel(const ModelContext& context, Model** result) noexcept {
  *result = new IdleModel<kLatentBytes>(context.action_size);
  return OkStatus();
}

// Behaves until the first update; then imagines values that are not finite, or
// says that it was given wrong sizes.
template <bool kNan>
class FaultyModel final : public IdleModel<kLatentAlignment> {
 public:
  using IdleModel::IdleModel;
  Status Value(ConstLatents latents, View<double> values) noexcept override {
    if (!trained_) return IdleModel::Value(latents, values);
    if (!kNan) return Error(StatusCode::kInvalidArgument, "expected 3, found 4");
    for (double& value : values) value = std::numeric_limits<double>::quiet_NaN();
    return OkStatus();
  }
  Status Train(const TrainRequest&, View<double>) noexcept override {
    trained_ = true;
    return OkStatus();
  }

 private:
  bool trained_ = false;
};

template <bool kNan>
Status MakeModel(const ModelContext& context, Model** result) noexcept {
  *result = new FaultyModel<kNan>(context.action_size);
  return OkStatus();
}

// One number to see, two to set, 10 steps an episode; and one thing wrong about it.
enum class Claim {
  kGood,
  kNoSteps,
  kShortBounds,
  kNanBound,
  kEqualBounds,
  kEndless,
  kEndlessFirst,
  kOddParts,
  kUnsetReward,
  kHalfDiscount,
  kFalseReturn,
  kWritesBeside
};

template <Claim kClaim>
class FaultyEnvironment final : public Environment {
 public:
  explicit FaultyEnvironment(bool first)
      : endless_(kClaim == Claim::kEndless || (kClaim == Claim::kEndlessFirst && first)) {
    spec_.observation_size = 1;
    spec_.action_size = 2;
    spec_.action_low = {low_, kClaim == Claim::kShortBounds ? 1u : 2u};
    spec_.action_high = {high_, 2};
    spec_.control_seconds = 0.1;
    spec_.episode_steps = kClaim == Claim::kNoSteps ? 0 : 10;
    if (kClaim == Claim::kOddParts) spec_.observation = {&part_, 1};
    spec_.return_high = kClaim == Claim::kFalseReturn ? -1 : 0;
    spec_.return_low = kClaim == Claim::kFalseReturn ? -2 : 0;
    if (kClaim == Claim::kNanBound) high_[1] = std::numeric_limits<double>::quiet_NaN();
    if (kClaim == Claim::kEqualBounds) high_[1] = low_[1];
  }
  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t, View<double> observation) noexcept override {
    steps_ = 0;
    observation[0] = 0;
    return OkStatus();
  }
  Status Step(View<const double>, View<double> observation, StepResult* result) noexcept override {
    observation[0] = 0;
    if (kClaim != Claim::kUnsetReward) result->reward = 0;
    if (kClaim == Claim::kHalfDiscount) result->discount = 0.5;
    if (kClaim == Claim::kWritesBeside) observation.data[1] = 0;
    result->last = !endless_ && ++steps_ == 10;
    return OkStatus();
  }
  void Destroy() noexcept override { delete this; }

 private:
  double low_[2] = {-1, -1}, high_[2] = {1, 1};
  ObservationPart part_{"pair", 2};
  EnvironmentSpec spec_;
  bool endless_;
  int steps_ = 0;
};

// A training's own environment is the first that its process makes.
template <Claim kClaim>
Status MakeEnvironment(const EnvironmentContext&, Environment** result) noexcept {
  static bool first = true;
  *result = new FaultyEnvironment<kClaim>(first);
  first = false;
  return OkStatus();
}

constexpr ComponentDescriptor FaultyEnvironmentDescriptor(const char* name,
                                                          EnvironmentFactory factory) {
  return {.kind = ComponentKind::kEnvironment,
          .name = name,
          .version = "1.0.0",
          .summary = "says what is not so",
          .create_environment = factory};
}

constexpr ComponentDescriptor FaultyPlannerDescriptor(const char* name, PlannerFactory factory,
                                                      std::uint32_t traits = kSearches) {
  return {.kind = ComponentKind::kPlanner,
          .traits = traits,
          .name = name,
          .version = "1.0.0",
          .summary = "fails on purpose",
          .create_planner = factory};
}

constexpr ComponentDescriptor FaultyModelDescriptor(const char* name, ModelFactory factory,
                                                    std::uint32_t traits = 0) {
  return {.kind = ComponentKind::kModel,
          .traits = traits,
          .name = name,
          .version = "1.0.0",
          .summary = "fails on purpose",
          .create_model = factory};
}

constexpr ComponentDescriptor kComponents[] = {
    FaultyPlannerDescriptor("nan_action", MakePlanner<Fault::kNan>),
    FaultyPlannerDescriptor("outside_action", MakePlanner<Fault::kOutside>),
    FaultyPlannerDescriptor("throwing_planner", MakePlanner<Fault::kThrow>),
    FaultyPlannerDescriptor("segfault_planner", MakePlanner<Fault::kSegfault>),
    FaultyPlannerDescriptor("exiting_planner", MakePlanner<Fault::kExit>),
    FaultyPlannerDescriptor("quitting_planner", MakePlanner<Fault::kQuit>),
    FaultyPlannerDescriptor("unmakeable_planner", MakeUnmakeable),
    FaultyPlannerDescriptor("hanging_planner", MakePlanner<Fault::kHang>),
    FaultyPlannerDescriptor("sleeping_planner", MakePlanner<Fault::kSleep>),
    FaultyPlannerDescriptor("hoarding_planner", MakePlanner<Fault::kMemory>),
    FaultyPlannerDescriptor("segfault_at_stop_planner", MakePlanner<Fault::kSegfaultAtStop>),
    FaultyPlannerDescriptor("unset_value", MakePlanner<Fault::kUnsetValue>),
    FaultyPlannerDescriptor("writes_beside", MakePlanner<Fault::kWritesBeside>),
    FaultyPlannerDescriptor("null_planner", MakeNull),
    FaultyPlannerDescriptor("slow_planner", MakeSlow),
    FaultyPlannerDescriptor("half_actor", MakeHalfActor, kActorAlone),
    FaultyPlannerDescriptor("secret_search", MakeSecretSearch, 0),
    FaultyModelDescriptor("nan_model", MakeModel<true>, kLearns),
    FaultyModelDescriptor("wrong_size_model", MakeModel<false>, kLearns),
    FaultyModelDescriptor("idle_model", MakeIdleModel<kLatentAlignment>),
    FaultyModelDescriptor("no_latent", MakeIdleModel<0>),
    FaultyModelDescriptor("odd_latent", MakeIdleModel<kLatentAlignment + 8>),
    FaultyEnvironmentDescriptor("good_environment", MakeEnvironment<Claim::kGood>),
    FaultyEnvironmentDescriptor("no_steps", MakeEnvironment<Claim::kNoSteps>),
    FaultyEnvironmentDescriptor("short_bounds", MakeEnvironment<Claim::kShortBounds>),
    FaultyEnvironmentDescriptor("nan_bound", MakeEnvironment<Claim::kNanBound>),
    FaultyEnvironmentDescriptor("equal_bounds", MakeEnvironment<Claim::kEqualBounds>),
    FaultyEnvironmentDescriptor("odd_parts", MakeEnvironment<Claim::kOddParts>),
    FaultyEnvironmentDescriptor("unset_reward", MakeEnvironment<Claim::kUnsetReward>),
    FaultyEnvironmentDescriptor("half_discount", MakeEnvironment<Claim::kHalfDiscount>),
    FaultyEnvironmentDescriptor("false_return", MakeEnvironment<Claim::kFalseReturn>),
    FaultyEnvironmentDescriptor("stray_observation", MakeEnvironment<Claim::kWritesBeside>),
    FaultyEnvironmentDescriptor("endless", MakeEnvironment<Claim::kEndless>),
    FaultyEnvironmentDescriptor("endless_training", MakeEnvironment<Claim::kEndlessFirst>),
};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("faulty", "1.0.0", dreamsearch::kComponents)
