// every_plugin_test.cc - every component of every plugin of the build keeps the laws of its kind.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "dreamsearch/check/gtest.h"

namespace dreamsearch::check {
namespace {

constexpr char kFolder[] = DREAMSEARCH_SOURCE_DIR;

// Where a component's defaults cannot serve.
std::vector<Setting> SettingsOf(const std::string& component) {
  if (component == "gym") {
    return {{"id", 0, "Walk"},
            {"module", 0, std::string(kFolder) + "/tests/plugins/env_gym/worlds.py"},
            {"python", 0, "/usr/bin/python3"}};  // which Debian's NumPy belongs to
  }
  if (component.starts_with("mjcf")) {
    return {{"model", 0, std::string(kFolder) + "/plugins/env_mjcf/example/crane.xml"},
            {"reward", 0, "tolerance(position(rope), margin=1)"},
            {"control_step", 0.02, ""},
            {"episode_steps", 100, ""}};
  }
  return {};
}

class PluginTest : public testing::TestWithParam<const ComponentDescriptor*> {};

TEST_P(PluginTest, KeepsTheLaws) {
  const ComponentDescriptor& component = *GetParam();
  const std::string name = component.name;
  if (name == "dm") GTEST_SKIP() << "needs Python's dm_control; shares its code with gym";
  Options options;
  options.case_seconds = 120;  // on a machine that does much else
  options.extreme_seconds = 1;
  options.memory_bytes = 2ull << 30;
  // Our own models answer a row with the same bits whatever the number of rows.
  ExpectLaws({.component = &component, .settings = SettingsOf(name), .exact_rows = true}, options);
}

std::vector<const ComponentDescriptor*> AllComponents(ComponentKind kind) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(DREAMSEARCH_TEST_PLUGIN_DIR)) {
    if (entry.path().extension() == ".so") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  std::vector<const ComponentDescriptor*> found;
  for (const std::string& file : files) {
    for (const ComponentDescriptor& component : LoadPlugin(file).components) {
      if (component.kind == kind) found.push_back(&component);
    }
  }
  return found;
}

std::string NameOf(const testing::TestParamInfo<const ComponentDescriptor*>& info) {
  return info.param->name;
}
INSTANTIATE_TEST_SUITE_P(Planners, PluginTest,
                         testing::ValuesIn(AllComponents(ComponentKind::kPlanner)), NameOf);
INSTANTIATE_TEST_SUITE_P(Models, PluginTest,
                         testing::ValuesIn(AllComponents(ComponentKind::kModel)), NameOf);
INSTANTIATE_TEST_SUITE_P(Environments, PluginTest,
                         testing::ValuesIn(AllComponents(ComponentKind::kEnvironment)), NameOf);

}  // namespace

}  // namespace dreamsearch::check
