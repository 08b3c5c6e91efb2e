// best_of_samples_test.cc - the laws of planners; add what is true of this planner alone.
#include "dreamsearch/check/gtest.h"

namespace dreamsearch::check {
namespace {

DREAMSEARCH_CHECK_PLUGIN(BestOfSamples, PLUGIN_FILE)

// A law may need more time on a loaded machine, or settings of your own.
TEST(BestOfSamples, KeepsTheLawsWithASingleSample) {
  const ComponentDescriptor& component = LoadPlugin(PLUGIN_FILE).components[0];
  Options options;
  options.level = Level::kLaws;
  options.case_seconds = 60;
  ExpectLaws({.component = &component, .settings = {{"samples", 1, ""}}}, options);
}

}  // namespace
}  // namespace dreamsearch::check
