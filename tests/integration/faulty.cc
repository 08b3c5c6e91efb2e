// faulty.cc - components that fail on request, to test that the host contains it.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "dreamsearch/plugin.h"

namespace dreamsearch {
namespace {

// Not inlined, so that the compiler does not see a throw in a noexcept function.
[[gnu::noinline]] void Throw() { throw std::runtime_error("thrown on purpose"); }

[[gnu::noinline]] void WriteToNull() {
  volatile int* const volatile null = nullptr;
  *null = 1;
}

// Until a signal handler has run; says so in the run's log first.
[[gnu::noinline]] void AwaitSignal() {
  std::fputs("waiting\n", stderr);
  ::pause();
}

enum class Fault { kNan, kOutside, kThrow, kSegfault, kExit, kHang, kSleep, kSegfaultAtStop };

template <Fault kFault>
class FaultyPlanner final : public Planner {
 public:
  Status BeginEpisode(LatentModel*) noexcept override { return OkStatus(); }
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    for (double& entry : result->action) entry = 0;
    result->value = 0;
    if (request.environment_step < 1500) return OkStatus();
    switch (kFault) {
      case Fault::kNan: result->action[0] = std::numeric_limits<double>::quiet_NaN(); break;
      case Fault::kOutside: result->action[0] = 1.5; break;
      case Fault::kThrow: Throw(); break;
      case Fault::kSegfault: WriteToNull(); break;
      case Fault::kExit: std::_Exit(0);
      case Fault::kHang: {
        volatile bool forever = true;
        while (forever) {
        }
        break;
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

// Behaves until the first update; then imagines values that are not finite, or
// says that it was given wrong sizes.
template <bool kNan>
class FaultyModel final : public Model {
 public:
  explicit FaultyModel(std::uint64_t actions) : actions_(actions) {}
  std::uint64_t latent_bytes() const noexcept override { return kLatentAlignment; }
  std::uint64_t action_size() const noexcept override { return actions_; }
  Status Imagine(const ImagineRequest&, const ImagineResult&) noexcept override {
    return Error(StatusCode::kUnimplemented, "not imagined");
  }
  Status Value(ConstLatents, View<double> values) noexcept override {
    if (trained_ && !kNan) return Error(StatusCode::kInvalidArgument, "expected 3, found 4");
    for (double& value : values) {
      value = trained_ ? std::numeric_limits<double>::quiet_NaN() : 0;
    }
    return OkStatus();
  }
  Status ProposeMode(ConstLatents, MatrixView<double> actions) noexcept override {
    std::memset(actions.data, 0, actions.size() * sizeof(double));
    return OkStatus();
  }
  Status ProposeSamples(ConstLatents latents, std::uint64_t,
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
    trained_ = true;
    return OkStatus();
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  Status Export(TensorSink*) const noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  std::uint64_t actions_;
  bool trained_ = false;
};

template <bool kNan>
Status MakeModel(const ModelContext& context, Model** result) noexcept {
  *result = new FaultyModel<kNan>(context.action_size);
  return OkStatus();
}

constexpr ComponentDescriptor FaultyPlannerDescriptor(const char* name, PlannerFactory factory) {
  return {.kind = ComponentKind::kPlanner,
          .name = name,
          .version = "1.0.0",
          .summary = "fails on purpose",
          .create_planner = factory};
}

constexpr ComponentDescriptor FaultyModelDescriptor(const char* name, ModelFactory factory) {
  return {.kind = ComponentKind::kModel,
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
    FaultyPlannerDescriptor("hanging_planner", MakePlanner<Fault::kHang>),
    FaultyPlannerDescriptor("sleeping_planner", MakePlanner<Fault::kSleep>),
    FaultyPlannerDescriptor("segfault_at_stop_planner", MakePlanner<Fault::kSegfaultAtStop>),
    FaultyPlannerDescriptor("null_planner", MakeNull),
    FaultyModelDescriptor("nan_model", MakeModel<true>),
    FaultyModelDescriptor("wrong_size_model", MakeModel<false>),
};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("faulty", "1.0.0", dreamsearch::kComponents)
