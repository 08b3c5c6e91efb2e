// Loading in this process: what a descriptor must hold, and what loading leaves
// behind. Libraries that end the process are catalogue_test.cc's.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "host/plugins/descriptor_check.h"
#include "host/plugins/plugin_loader.h"
#include "host/plugins/received_plugin.h"
#include "results/system/error.h"
#include "tests/host/plugins/corpus/tiny_plugin.h"
#include "tests/host/plugins/library_folder.h"

namespace dreamsearch {
namespace {

Failure Refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const Failure& error) {
    return error;
  }
  return Failure(ExitCode::kOk, "nothing was refused");
}

void ExpectMessage(const Failure& error, ExitCode code, const std::vector<std::string>& parts) {
  EXPECT_EQ(error.code(), code) << error.what();
  for (const std::string& part : parts) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos)
        << "expected '" << part << "' in: " << error.what();
  }
}

bool DenormalsWork() {
  volatile double tiny = 1e-310;
  return tiny * 0.5 != 0;
}

TEST(LoadPlugin, ReturnsTheDescriptorOfAGoodLibraryOnce) {
  const PluginDescriptor& plugin = LoadPlugin(Corpus("good"));
  EXPECT_STREQ(plugin.name, "good");
  EXPECT_STREQ(plugin.version, "1.2.3");
  EXPECT_EQ(plugin.components.size, 2u);
  EXPECT_EQ(&LoadPlugin(Corpus("good")), &plugin);
  EXPECT_TRUE(DenormalsWork());
}

TEST(LoadPlugin, FindsComponentsByKindAndNameOrAlias) {
  const PluginDescriptor& plugin = LoadPlugin(Corpus("good"));
  const ComponentDescriptor& planner = FindComponent(plugin, ComponentKind::kPlanner, "good");
  EXPECT_EQ(planner.kind, ComponentKind::kPlanner);
  EXPECT_EQ(&FindComponent(plugin, ComponentKind::kPlanner, "well"), &planner);
  EXPECT_NE(&FindComponent(plugin, ComponentKind::kModel, "good"), &planner);
  ExpectMessage(Refusal([&] { FindComponent(plugin, ComponentKind::kPlanner, "goood"); }),
                ExitCode::kNotFound, {"no planner 'goood'", "Did you mean good?"});
  ExpectMessage(Refusal([&] { FindComponent(plugin, ComponentKind::kModel, "fine"); }),
                ExitCode::kNotFound, {"no model 'fine'", "Known: good."});
}

TEST(LoadPlugin, RefusesFastMathAndKeepsDenormals) {
  // Twice: the second load runs no initialiser, and must not pass for that.
  for (int i = 0; i < 2; ++i) {
    ExpectMessage(Refusal([] { LoadPlugin(Corpus("fast_math")); }), ExitCode::kPluginRefused,
                  {"fast_math.so", "-ffast-math"});
    EXPECT_TRUE(DenormalsWork());
  }
}

TEST(LoadPlugin, RefusesAChangedRoundingModeAndPutsItBack) {
  ExpectMessage(Refusal([] { LoadPlugin(Corpus("changes_rounding")); }), ExitCode::kPluginRefused,
                {"rounding mode"});
  volatile double one = 1, tiny = 1e-30;
  EXPECT_EQ(one + tiny, 1);
}

TEST(LoadPlugin, NamesAMissingSymbolInsteadOfEndingAtTheFirstCall) {
  ExpectMessage(Refusal([] { LoadPlugin(Corpus("missing_symbol")); }), ExitCode::kPluginRefused,
                {"undefined symbol", "dreamsearch_test_defined_nowhere"});
}

TEST(LoadPlugin, NamesAMissingDependency) {
  ExpectMessage(Refusal([] { LoadPlugin(Corpus("missing_dependency")); }), ExitCode::kPluginRefused,
                {"libcorpus_vanished.so", "cannot open"});
}

TEST(LoadPlugin, SaysExpectedAndFoundOfAnotherSdk) {
  const auto refused = [](const std::string& name, const std::vector<std::string>& parts) {
    SCOPED_TRACE(name);
    ExpectMessage(Refusal([&] { LoadPlugin(Corpus(name)); }), ExitCode::kPluginRefused, parts);
  };
  refused("before_0_1", {"expected the symbol dreamsearch_sdk_1, found dreamsearch_plugin_v1: it "
                         "was built before SDK 1.0; rebuild it against this SDK (1.0)"});
  refused("before_1_0", {"found dreamsearch_plugin_v0: it was built before SDK 1.0; rebuild it"});
  refused("newer_major", {"expected the symbol dreamsearch_sdk_1, found dreamsearch_sdk_2 of "
                          "another major version of the SDK; rebuild it"});
  refused("other_major_field", {"expected SDK major version 1, found 7"});
  refused("short_descriptor", {"expected a descriptor of at least 64 bytes, a multiple of 8, "
                               "found 32 bytes"});
  refused("short_stride", {"the components: expected entries of at least 144 bytes, a multiple of "
                           "8, found 64 bytes"});
  refused("other_magic", {"magic number", "found 0x0000000000001234"});
  refused("no_entry", {"not a dreamsearch plugin"});
  refused("null_descriptor", {"returned no descriptor"});
}

// --- declarations ------------------------------------------------------------

Status MakeNoEnvironment(const EnvironmentContext&, Environment** result) noexcept {
  *result = nullptr;
  return OkStatus();
}

Status MakeNoModel(const ModelContext&, Model** result) noexcept {
  *result = nullptr;
  return OkStatus();
}

Failure CheckComponents(const std::vector<ComponentDescriptor>& components) {
  PluginDescriptor plugin;
  plugin.name = "tiny";
  plugin.version = "1";
  plugin.components = {components.data(), components.size()};
  return Refusal([&] {
    const ReceivedPlugin received(&plugin, "tiny.so");
    CheckDeclarations(received.plugin(), "tiny.so");
  });
}

Failure CheckChanged(const std::function<void(ComponentDescriptor*)>& change) {
  ComponentDescriptor component = TinyPlanner("tiny");
  change(&component);
  return CheckComponents({component});
}

Failure CheckParameters(const std::vector<ParameterSpec>& parameters) {
  return CheckChanged([&](ComponentDescriptor* component) {
    component->parameters = {parameters.data(), parameters.size()};
  });
}

TEST(ReceivedPlugin, LeavesOutOfANewerPluginWhatThisVersionDoesNotKnow) {
  ComponentDescriptor components[] = {TinyPlanner("tiny"), TinyPlanner("later")};
  components[0].traits = kSearches | 1u << 31;
  components[1].kind = static_cast<ComponentKind>(9);
  PluginDescriptor plugin;
  plugin.name = "tiny";
  plugin.version = "1";
  plugin.components = {components, 2};
  const auto refusal = [&] {
    return Refusal([&] {
      const ReceivedPlugin received(&plugin, "tiny.so");
      CheckDeclarations(received.plugin(), "tiny.so");
      ASSERT_EQ(received.plugin().components.size, 1u);
      EXPECT_STREQ(received.plugin().components[0].name, "tiny");
      EXPECT_EQ(received.plugin().components[0].traits, kSearches);
    });
  };
  plugin.sdk_minor = DREAMSEARCH_SDK_MINOR + 1;
  EXPECT_EQ(refusal().code(), ExitCode::kOk);
  // In a plugin of our own age both are mistakes.
  plugin.sdk_minor = DREAMSEARCH_SDK_MINOR;
  ExpectMessage(refusal(), ExitCode::kPluginRefused, {"component 0 ('tiny')"});
}

constexpr ExitCode kRefused = ExitCode::kPluginRefused;

TEST(CheckDeclarations, AcceptsTheTinyPlanner) {
  EXPECT_EQ(CheckChanged([](ComponentDescriptor*) {}).code(), ExitCode::kOk);
}

TEST(CheckDeclarations, WantsAKnownKindWithItsFactoryAlone) {
  ExpectMessage(CheckComponents({}), kRefused, {"at least one component"});
  ExpectMessage(CheckChanged([](auto* c) { c->kind = static_cast<ComponentKind>(4); }), kRefused,
                {"expected kind 1 (environment), 2 (model) or 3 (planner), found 4"});
  ExpectMessage(CheckChanged([](auto* c) { c->create_planner = nullptr; }), kRefused,
                {"expected create_planner", "found none"});
  ExpectMessage(CheckChanged([](auto* c) { c->create_environment = MakeNoEnvironment; }), kRefused,
                {"expected create_planner", "create_environment create_planner"});
  ExpectMessage(CheckChanged([](auto* c) { c->kind = ComponentKind::kModel; }), kRefused,
                {"expected create_model", "found create_planner"});
}

TEST(CheckDeclarations, WantsTraitsOfTheKindAndNoneThatContradictEachOther) {
  ExpectMessage(CheckChanged([](auto* c) { c->traits = kNeedsEnvironment; }), kRefused,
                {"component 0 ('tiny')", "those of a planner", "found 8"});
  ExpectMessage(CheckChanged([](auto* c) { c->traits = 1u << 31; }), kRefused,
                {"those of a planner", "found 2147483648"});
  ExpectMessage(CheckChanged([](auto* c) { c->traits = kSearches | kActorAlone; }), kRefused,
                {"expected kSearches or kActorAlone, found both"});
  EXPECT_EQ(CheckChanged([](auto* c) { c->traits = kActorAlone; }).code(), ExitCode::kOk);
}

TEST(CheckDeclarations, RefusesRunPresetsOfAPlannerOrNotClear) {
  static constexpr RunPreset kOne[] = {{"batch_size", "fast", 256}};
  static constexpr RunPreset kTwice[] = {{"batch_size", "fast", 256}, {"batch_size", "fast", 128}};
  static constexpr RunPreset kInfinite[] = {
      {"batch_size", "fast", std::numeric_limits<double>::infinity()}};
  static constexpr RunPreset kNameless[] = {{"batch_size", nullptr, 1}};
  const auto as_model = [](ComponentDescriptor* c, View<const RunPreset> presets) {
    c->kind = ComponentKind::kModel;
    c->traits = kLearns;
    c->create_planner = nullptr;
    c->create_model = MakeNoModel;
    c->run_presets = presets;
  };
  EXPECT_EQ(CheckChanged([&](auto* c) { as_model(c, ViewOf(kOne)); }).code(), ExitCode::kOk);
  ExpectMessage(CheckChanged([](auto* c) { c->run_presets = ViewOf(kOne); }), kRefused,
                {"run presets are for models and environments"});
  ExpectMessage(CheckChanged([&](auto* c) { as_model(c, ViewOf(kTwice)); }), kRefused,
                {"batch_size", "'fast'", "found two"});
  ExpectMessage(CheckChanged([&](auto* c) { as_model(c, ViewOf(kInfinite)); }), kRefused,
                {"expected a finite number"});
  ExpectMessage(CheckChanged([&](auto* c) { as_model(c, ViewOf(kNameless)); }), kRefused,
                {"its preset"});
}

TEST(CheckDeclarations, WantsNamesThatAreUniqueInAKind) {
  for (const char* name :
       {"", "Upper", "9lives", "with space", "a-b", "\xc3\xa9t\xc3\xa9", "a.b"}) {
    EXPECT_EQ(CheckChanged([&](auto* c) { c->name = name; }).code(), kRefused) << name;
  }
  ExpectMessage(CheckChanged([](auto* c) { c->name = nullptr; }), kRefused, {"null pointer"});
  ExpectMessage(CheckChanged([](auto* c) { c->aliases = "one,tiny"; }), kRefused,
                {"two components offer the planner 'tiny'"});
  ExpectMessage(CheckChanged([](auto* c) { c->aliases = "one,,two"; }), kRefused, {"is empty"});
  EXPECT_EQ(CheckChanged([](auto* c) { c->aliases = "one,two"; }).code(), ExitCode::kOk);
}

TEST(CheckDeclarations, WantsTextsOfOneLineInUtf8) {
  ExpectMessage(CheckChanged([](auto* c) { c->summary = "two\nlines"; }), kRefused,
                {"byte 10 at 3"});
  ExpectMessage(CheckChanged([](auto* c) { c->summary = "bad \xff byte"; }), kRefused, {"UTF-8"});
  ExpectMessage(CheckChanged([](auto* c) { c->summary = "cut \xe2\x82"; }), kRefused, {"UTF-8"});
  ExpectMessage(CheckChanged([](auto* c) { c->version = ""; }), kRefused, {"version is empty"});
  const std::string endless(20000, 'x');
  ExpectMessage(CheckChanged([&](auto* c) { c->summary = endless.c_str(); }), kRefused,
                {"longer than"});
  EXPECT_EQ(CheckChanged([](auto* c) { c->summary = "caf\xc3\xa9 \xe2\x82\xac"; }).code(),
            ExitCode::kOk);
}

TEST(CheckDeclarations, WantsDefaultsAndPresetsInsideTheirRange) {
  ExpectMessage(CheckParameters({RealParameter("k", 2, 0, 1, "", "h")}), kRefused,
                {"parameter 'k'", "its default", "expected 0 to 1, found 2"});
  ExpectMessage(CheckParameters({RealParameter("k", 1, 2, 0, "", "h")}), kRefused,
                {"its range is empty"});
  ExpectMessage(
      CheckParameters({RealParameter("k", 1, 0, std::numeric_limits<double>::infinity(), "", "h")}),
      kRefused, {"finite range"});
  ExpectMessage(CheckParameters(
                    {RealParameter("k", std::numeric_limits<double>::quiet_NaN(), 0, 1, "", "h")}),
                kRefused, {"its default", "nan"});
  ExpectMessage(CheckParameters({IntParameter("k", 1, 0, 9, "", "h").Preset("fast", 2.5)}),
                kRefused, {"preset 'fast'", "expected an integer, found 2.5"});
  ExpectMessage(CheckParameters({IntParameter("k", 1, 0, 9, "", "h").Preset("fast", 10)}), kRefused,
                {"preset 'fast'", "expected 0 to 9, found 10"});
  ExpectMessage(
      CheckParameters({IntParameter("k", 1, 0, 9, "", "h").Preset("fast", 1).Preset("fast", 2)}),
      kRefused, {"preset 'fast' is given twice"});
  ExpectMessage(CheckParameters({BoolParameter("k", true, "h").Preset("fast", 2)}), kRefused,
                {"expected 0 or 1, found 2"});
}

TEST(CheckDeclarations, WantsChoicesThatHoldTheDefaultAndThePresets) {
  ExpectMessage(CheckParameters({ChoiceParameter("k", "three", "one,two", "h")}), kRefused,
                {"expected one of one,two, found 'three'"});
  ExpectMessage(CheckParameters({ChoiceParameter("k", "one", "one,one", "h")}), kRefused,
                {"choices that differ"});
  ExpectMessage(
      CheckParameters({ChoiceParameter("k", "one", "one,two", "h").Preset("fast", "six")}),
      kRefused, {"preset 'fast'", "found 'six'"});
}

TEST(CheckDeclarations, WantsEachParameterAndMetricOnce) {
  ExpectMessage(CheckParameters({BoolParameter("k", true, "h"), BoolParameter("k", true, "h")}),
                kRefused, {"two parameters are called 'k'"});
  ParameterSpec strange = BoolParameter("k", true, "h");
  strange.type = static_cast<ParameterType>(8);
  ExpectMessage(CheckParameters({strange}), kRefused, {"found 8"});
  strange = BoolParameter("k", true, "h");
  strange.preset_count = kMaxPresets + 1;
  ExpectMessage(CheckParameters({strange}), kRefused, {"at most 4 presets, found 5"});
  const std::vector<MetricSpec> metrics = {{"m", "", ""}, {"m", "", ""}};
  ExpectMessage(CheckChanged([&](auto* c) {
                  c->metrics = {metrics.data(), metrics.size()};
                }),
                kRefused, {"two metrics are called 'm'"});
  ExpectMessage(CheckChanged([&](auto* c) {
                  c->metrics = {nullptr, 3};
                }),
                kRefused, {"3 entries at a null address"});
}

}  // namespace
}  // namespace dreamsearch
