// plugin.cc - an environment, a model and a planner, built against this version of the SDK and
// against the next. They answer with what they were told: the fields that came later too.
#include <algorithm>
#include <cstring>

#include "dreamsearch/planning.h"
#include "tests/sdk/versions/both_versions.h"

namespace dreamsearch {
namespace {

// Offered by the next version's plugin alone; no host knows it.
class Greeting {
 public:
  static constexpr const char* kName = "greeting/1";
  virtual void Greet() noexcept = 0;

 protected:
  ~Greeting() = default;
};

constexpr ObservationPart kParts[] = {{"told", 3}, {"nothing", 0}};
constexpr double kLow[] = {-2}, kHigh[] = {2};

// Observes what it was told: the value of its parameter, the context's and its own `grown`.
class World final : public Offers<Environment, StateSaving, Rendering> {
 public:
  explicit World(const EnvironmentContext& context) {
    const EnvironmentContext received = Received(context);
    told_[0] = received.parameters.Find("start")->number;
    told_[1] = GrownOf(received);
    told_[2] = received.action_repeat;
    spec_.observation = ViewOf(kParts);
    spec_.observation_size = 3;
    spec_.action_size = 1;
    spec_.action_low = ViewOf(kLow);
    spec_.action_high = ViewOf(kHigh);
    spec_.control_seconds = 0.5;
    spec_.episode_steps = 4;
    spec_.notice = "told";
    SetGrown(21, &spec_);
  }
  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t, View<double> observation) noexcept override {
    std::copy_n(told_, 3, observation.data);
    return OkStatus();
  }
  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override {
    result->reward = action[0];
    result->last = true;
    GiveGrown(22, result);
    return Reset(0, observation);
  }
  std::uint64_t state_bytes() const noexcept override { return sizeof told_; }
  Status SaveState(View<std::byte> state) const noexcept override {
    std::memcpy(state.data, told_, sizeof told_);
    return OkStatus();
  }
  Status RestoreState(View<const std::byte> state) noexcept override {
    std::memcpy(told_, state.data, sizeof told_);
    return OkStatus();
  }
  Status Render(const RenderRequest& request, View<std::uint8_t> rgb) noexcept override {
    const RenderRequest received = Received(request);
    std::fill(rgb.begin(), rgb.end(), static_cast<std::uint8_t>(2 * GrownOf(received)));
    return OkStatus();
  }
  void Destroy() noexcept override { delete this; }

 private:
  ~World() = default;
  double told_[3];
  EnvironmentSpec spec_;
};

// Every number that it gives is 100 and the `grown` of the request.
class Mind final : public Offers<Model, ValueSpread, ReturnGradient> {
 public:
  explicit Mind(const ModelContext& context) : grown_(GrownOf(Received(context))) {}
  std::uint64_t latent_bytes() const noexcept override { return kLatentAlignment; }
  std::uint64_t action_size() const noexcept override { return 1; }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    const double told = 100 + GrownOf(Received(request));
    std::memset(result.latents.data, 0, result.latents.size());
    std::fill(result.rewards.begin(), result.rewards.end(), told);
    std::fill(result.discounts.begin(), result.discounts.end(), 1);
    return OkStatus();
  }
  Status Value(ConstLatents, View<double> values) noexcept override {
    std::fill(values.begin(), values.end(), grown_);
    return OkStatus();
  }
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override {
    const SpreadResult received = Received(result);
    std::fill(received.deviations.begin(), received.deviations.end(), GrownOf(received));
    return Value(latents, received.values);
  }
  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept override {
    const double told = 100 + GrownOf(Received(request));
    const GradientResult received = Received(result);
    std::fill(received.returns.begin(), received.returns.end(), told);
    std::fill_n(received.gradients.data, received.gradients.size(), GrownOf(received));
    return OkStatus();
  }
  Status ProposeMode(ConstLatents, MatrixView<double> actions) noexcept override {
    std::fill_n(actions.data, actions.size(), 0.5);
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
  Status Observe(const ObserveRequest& request, Latents latents) noexcept override {
    const double told = GrownOf(Received(request));
    std::memset(latents.data, 0, latents.size());
    std::memcpy(latents.data, &told, sizeof told);
    return OkStatus();
  }
  Status Train(const TrainRequest& request, View<double> metrics) noexcept override {
    const TrainRequest received = Received(request);
    const SequenceBatch batch = Received(*received.batch);
    metrics[0] = static_cast<double>(batch.length);
    metrics[1] = GrownOf(received);
    metrics[2] = GrownOf(batch);
    return OkStatus();
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  ~Mind() = default;
  double grown_;
};

// Asks the model for everything and reports the answers.
enum { kContextGrown, kRequestGrown, kReward, kValue, kDeviation, kReturn, kSlope, kMetricCount };
constexpr MetricSpec Metric(const char* name) {
  MetricSpec metric{name, "", "What it was told."};
  SetGrown(23, &metric);
  return metric;
}
constexpr MetricSpec kMetrics[] = {Metric("context"), Metric("request"),   Metric("reward"),
                                   Metric("value"),   Metric("deviation"), Metric("return"),
                                   Metric("slope")};

template <typename Base>
class Voice : public Base {
 public:
  explicit Voice(const PlannerContext& context)
      : Base(context, kMetricCount), grown_(GrownOf(Received(context))) {}
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    const PlanRequest received = Received(request);
    if (Status status = CheckPlan(this->sizes_, this->model_, received, result); !status.ok()) {
      return status;
    }
    alignas(kLatentAlignment) std::byte next[kLatentAlignment];
    const Latents to{next, 1, sizeof next};
    const double action = 0.25;
    const std::uint64_t seed = received.seed;
    double discount = 0;
    ImagineRequest imagine{received.root, {&action, 1, 1}, {&seed, 1}};
    SetGrown(31, &imagine);
    const View<double>& metrics = result->metrics;
    Status status = this->model_->Imagine(imagine, {to, {&metrics[kReward], 1}, {&discount, 1}});
    if (!status.ok()) return status;
    status = this->model_->ProposeMode(to, {result->action.data, 1, 1});
    if (!status.ok()) return status;
    SpreadResult spread{{&metrics[kValue], 1}, {&metrics[kDeviation], 1}};
    SetGrown(32, &spread);
    status = ExtensionOf<ValueSpread>(this->model_)->Spread(to, spread);
    if (!status.ok()) return status;
    GradientRequest gradient{received.root, {&action, 1, 1}, {&seed, 1}};
    SetGrown(33, &gradient);
    GradientResult slopes{{&metrics[kReturn], 1}, {&metrics[kSlope], 1, 1}};
    SetGrown(34, &slopes);
    status = ExtensionOf<ReturnGradient>(this->model_)->Gradient(gradient, slopes);
    if (!status.ok()) return status;
    metrics[kContextGrown] = grown_;
    metrics[kRequestGrown] = GrownOf(received);
    result->value = 1;
    result->simulations = 2;
    result->nodes = 3;
    result->depth = 4;
    GiveGrown(24, result);
    return OkStatus();
  }

 private:
  double grown_;
};

class Speaker final : public Voice<Offers<MemorylessPlanner, TreeReporting, Greeting>> {
 public:
  using Voice::Voice;
  void ReportTree(TreeSink* sink) noexcept override {
    TreeEdge edge;
    edge.q = 5;
    SetGrown(25, &edge);
    sink->Edge(edge);
  }
  void Greet() noexcept override {}
};

constexpr ParameterSpec Declared() {
  ParameterSpec spec =
      RealParameter("start", 0.25, 0, 1, "m", "Where it begins.").Preset("fast", 1);
  SetGrown(26, &spec);
  return spec;
}
constexpr ParameterSpec kParameters[] = {Declared(),
                                         BoolParameter("second", true, "So that there are two.")};
constexpr MetricSpec kModelMetrics[] = {Metric("length"), Metric("request"), Metric("batch")};

constexpr std::uint32_t LaterTrait() {
  if constexpr (kGrown) return 1u << 30;
  return 0;
}

constexpr ComponentDescriptor kComponents[] = {
    {.kind = ComponentKind::kEnvironment,
     .name = "world",
     .version = "1.0.0",
     .summary = "Tells what it was told",
     .parameters = ViewOf(kParameters),
     .create_environment = CreateEnvironment<World>},
    {.kind = ComponentKind::kModel,
     .traits = kLearns | kGivesGradients,
     .name = "mind",
     .version = "1.0.0",
     .summary = "Tells what it was told",
     .metrics = ViewOf(kModelMetrics),
     .create_model = CreateModel<Mind>},
    {.kind = ComponentKind::kPlanner,
     .traits = kSearches | kNeedsGradients | LaterTrait(),
     .name = "speaker",
     .version = "1.0.0",
     .summary = "Tells what it was told",
     .metrics = ViewOf(kMetrics),
     .create_planner = CreatePlanner<Speaker>},
};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("versions", "1.0.0", dreamsearch::kComponents)
