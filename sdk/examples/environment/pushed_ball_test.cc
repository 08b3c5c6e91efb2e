// pushed_ball_test.cc - the laws of environments; add what is true of this task alone.
#include "dreamsearch/check/gtest.h"

namespace dreamsearch::check {
namespace {

DREAMSEARCH_CHECK_PLUGIN(PushedBall, PLUGIN_FILE)

// A law may need more time on a loaded machine, or settings of your own.
TEST(PushedBall, KeepsTheLawsInShortEpisodes) {
  const ComponentDescriptor& component = LoadPlugin(PLUGIN_FILE).components[0];
  Options options;
  options.level = Level::kLaws;
  options.case_seconds = 60;
  ExpectLaws({.component = &component, .settings = {{"episode_steps", 3, ""}}}, options);
}

}  // namespace
}  // namespace dreamsearch::check
