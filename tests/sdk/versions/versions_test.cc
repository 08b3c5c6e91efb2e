// versions_test.cc - two minor versions of the SDK in one process. Compiled twice, as a host of
// this version and as one of the next; each loads the plugin that was
// built against this version and the one that was built against the next.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "host/plugins/model_proxy.h"
#include "host/plugins/plugin_loader.h"
#include "tests/plugins/owned.h"
#include "tests/sdk/versions/both_versions.h"

namespace dreamsearch {
namespace {

constexpr double kGuard = -12345.5;

// A struct of this host's version; whoever writes a longer one writes into `after`.
template <typename Struct>
struct Guarded {
  Struct made;
  double after[8] = {kGuard, kGuard, kGuard, kGuard, kGuard, kGuard, kGuard, kGuard};

  void ExpectUntouched() const {
    for (const double guard : after) EXPECT_EQ(guard, kGuard) << "written beyond the struct";
  }
};

struct Built {
  const char* file;
  bool grown;  // against the next version
};
constexpr Built kPlugins[] = {{"versions_this", false}, {"versions_next", true}};

// What side B is told of a field that side A set to `set`: the field must be known to both and to
// the host between them.
double Told(bool known, double set) { return known && kGrown ? set : kUnset; }

const ComponentDescriptor& Component(const Built& built, ComponentKind kind, const char* name) {
  return FindComponent(LoadPlugin(std::string(DREAMSEARCH_VERSIONS_DIR) + "/" + built.file + ".so"),
                       kind, name);
}

struct Declared {
  ParameterValue values[2] = {{"start", 0.75, nullptr}, {"second", 1, nullptr}};
  Parameters parameters{Records<ParameterValue>(values, 2)};
};

Owned<Model> MakeMind(const Built& built) {
  Guarded<ModelContext> context;
  context.made.action_size = 1;
  SetGrown(11, &context.made);
  Model* model = nullptr;
  EXPECT_TRUE(
      Component(built, ComponentKind::kModel, "mind").create_model(context.made, &model).ok());
  return Owned<Model>(model);
}

TEST(SdkVersions, DeclarationsOfBothVersionsAreRead) {
  for (const Built& built : kPlugins) {
    SCOPED_TRACE(built.file);
    const ComponentDescriptor& world = Component(built, ComponentKind::kEnvironment, "world");
    ASSERT_EQ(world.parameters.size, 2u);
    const ParameterSpec& start = world.parameters[0];
    EXPECT_STREQ(start.name, "start");
    EXPECT_EQ(start.default_number, 0.25);
    EXPECT_EQ(start.preset_count, 1u);
    EXPECT_STREQ(start.presets[0].preset, "fast");
    EXPECT_EQ(GrownOf(start), Told(built.grown, 26));
    EXPECT_STREQ(world.parameters[1].name, "second");
    EXPECT_EQ(GrownOf(world.parameters[1]), kUnset);
    const ComponentDescriptor& speaker = Component(built, ComponentKind::kPlanner, "speaker");
    ASSERT_EQ(speaker.metrics.size, 7u);
    EXPECT_STREQ(speaker.metrics[6].name, "slope");
    EXPECT_EQ(GrownOf(speaker.metrics[6]), Told(built.grown, 23));
    EXPECT_EQ(GrownOf(speaker), kUnset);
  }
}

TEST(SdkVersions, ATraitThatTheHostDoesNotKnowIsPassedOver) {
  for (const Built& built : kPlugins) {
    const std::uint32_t later = kGrown && built.grown ? 1u << 30 : 0;
    EXPECT_EQ(Component(built, ComponentKind::kPlanner, "speaker").traits,
              kSearches | kNeedsGradients | later)
        << built.file;
  }
}

TEST(SdkVersions, EnvironmentsOfBothVersionsPlaySaveAndDraw) {
  for (const Built& built : kPlugins) {
    SCOPED_TRACE(built.file);
    const Declared declared;
    Guarded<EnvironmentContext> context;
    context.made.parameters = declared.parameters;
    context.made.action_repeat = 3;
    SetGrown(10, &context.made);
    Environment* made = nullptr;
    ASSERT_TRUE(Component(built, ComponentKind::kEnvironment, "world")
                    .create_environment(context.made, &made)
                    .ok());
    const Owned<Environment> world(made);
    const EnvironmentSpec spec = Received(world->spec());
    EXPECT_EQ(spec.observation_size, 3u);
    ASSERT_EQ(spec.observation.size, 2u);
    EXPECT_STREQ(spec.observation.At(1).name, "nothing");
    EXPECT_EQ(spec.observation[0].size, 3u);
    EXPECT_STREQ(spec.notice, "told");
    EXPECT_EQ(GrownOf(spec), Told(built.grown, 21));

    double observation[3] = {};
    ASSERT_TRUE(world->Reset(1, {observation, 3}).ok());
    EXPECT_EQ(observation[0], 0.75);
    EXPECT_EQ(observation[1], Told(built.grown, 10));
    EXPECT_EQ(observation[2], 3);

    Guarded<StepResult> step;
    const double action = 0.5;
    ASSERT_TRUE(world->Step({&action, 1}, {observation, 3}, &step.made).ok());
    EXPECT_EQ(step.made.reward, 0.5);
    EXPECT_TRUE(step.made.last);
    EXPECT_EQ(GrownOf(step.made), Told(built.grown, 22));
    step.ExpectUntouched();

    auto* saving = ExtensionOf<StateSaving>(world.get());
    std::vector<std::byte> state(saving->state_bytes());
    ASSERT_TRUE(saving->SaveState({state.data(), state.size()}).ok());
    ASSERT_TRUE(saving->RestoreState({state.data(), state.size()}).ok());
    Guarded<RenderRequest> render;
    render.made.width = render.made.height = 1;
    SetGrown(12, &render.made);
    std::uint8_t rgb[3] = {};
    ASSERT_TRUE(ExtensionOf<Rendering>(world.get())->Render(render.made, {rgb, 3}).ok());
    EXPECT_EQ(rgb[1], static_cast<int>(2 * Told(built.grown, 12)));
  }
}

TEST(SdkVersions, ModelsOfBothVersionsObserveAndTrain) {
  for (const Built& built : kPlugins) {
    SCOPED_TRACE(built.file);
    const Owned<Model> mind = MakeMind(built);
    alignas(kLatentAlignment) std::byte from[kLatentAlignment] = {}, to[kLatentAlignment] = {};
    const std::uint64_t seed = 1;
    const double zero[3] = {};
    Guarded<ObserveRequest> observe;
    observe.made.previous = {from, 1, sizeof from};
    observe.made.actions = {zero, 1, 1};
    observe.made.observations = {zero, 1, 3};
    observe.made.seeds = {&seed, 1};
    SetGrown(13, &observe.made);
    ASSERT_TRUE(mind->Observe(observe.made, {to, 1, sizeof to}).ok());
    double told = 0;
    std::memcpy(&told, to, sizeof told);
    EXPECT_EQ(told, Told(built.grown, 13));

    Guarded<SequenceBatch> batch;
    batch.made.length = 6;
    SetGrown(14, &batch.made);
    Guarded<TrainRequest> train;
    train.made.batch = &batch.made;
    SetGrown(15, &train.made);
    double metrics[3] = {};
    ASSERT_TRUE(mind->Train(train.made, {metrics, 3}).ok());
    EXPECT_EQ(metrics[0], 6);
    EXPECT_EQ(metrics[1], Told(built.grown, 15));
    EXPECT_EQ(metrics[2], Told(built.grown, 14));
  }
}

class Edges final : public TreeSink {
 public:
  void Edge(const TreeEdge& edge) noexcept override {
    const TreeEdge received = Received(edge);
    q = received.q;
    grown = GrownOf(received);
  }
  double q = 0, grown = 0;
};

// Through the host's proxy, as in a run.
TEST(SdkVersions, APlannerOfEitherVersionPlansWithAModelOfEither) {
  for (const Built& planning : kPlugins) {
    for (const Built& modelling : kPlugins) {
      SCOPED_TRACE(testing::Message() << planning.file << " with " << modelling.file);
      const bool both = planning.grown && modelling.grown;
      const Owned<Model> mind = MakeMind(modelling);
      Guarded<PlannerContext> context;
      context.made.action_size = 1;
      context.made.latent_bytes = kLatentAlignment;
      SetGrown(16, &context.made);
      Planner* made = nullptr;
      ASSERT_TRUE(Component(planning, ComponentKind::kPlanner, "speaker")
                      .create_planner(context.made, &made)
                      .ok());
      const Owned<Planner> speaker(made);
      ModelProxy proxy(mind.get(), "mind", true);
      ASSERT_TRUE(speaker->BeginEpisode(&proxy).ok());
      alignas(kLatentAlignment) std::byte root[kLatentAlignment] = {};
      double action = 0, metrics[7] = {};
      Guarded<PlanRequest> request;
      request.made.root = {root, 1, sizeof root};
      SetGrown(17, &request.made);
      Guarded<PlanResult> result;
      result.made.action = {&action, 1};
      result.made.metrics = {metrics, 7};
      const Status status = speaker->Plan(request.made, &result.made);
      ASSERT_TRUE(status.ok()) << status.message;
      result.ExpectUntouched();
      EXPECT_EQ(action, 0.5);
      EXPECT_EQ(result.made.value, 1);
      EXPECT_EQ(result.made.depth, 4u);
      EXPECT_EQ(GrownOf(result.made), Told(planning.grown, 24));
      const double told[7] = {Told(planning.grown, 16), Told(planning.grown, 17),
                              // Imagine goes through the proxy as it is.
                              100 + (both ? 31 : kUnset), Told(modelling.grown, 11), Told(both, 32),
                              100 + Told(both, 33), Told(both, 34)};
      for (int i = 0; i < 7; ++i) EXPECT_EQ(metrics[i], told[i]) << "metric " << i;
      EXPECT_EQ(proxy.transitions(), 2u);

      Edges edges;
      ExtensionOf<TreeReporting>(speaker.get())->ReportTree(&edges);
      EXPECT_EQ(edges.q, 5);
      EXPECT_EQ(edges.grown, Told(planning.grown, 25));
      EXPECT_NE(speaker->Extension("greeting/1"), nullptr);
      EXPECT_EQ(ExtensionOf<PolicyReporting>(speaker.get()), nullptr);
    }
  }
}

}  // namespace
}  // namespace dreamsearch
