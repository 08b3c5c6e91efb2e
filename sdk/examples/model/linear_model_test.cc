// linear_model_test.cc - the laws of models; add what is true of this model alone.
#include "dreamsearch/check/gtest.h"

namespace dreamsearch::check {
namespace {

DREAMSEARCH_CHECK_PLUGIN(LinearModel, PLUGIN_FILE)

// A law may need more time on a loaded machine, or settings of your own.
TEST(LinearModel, AnswersARowWithTheSameBitsAmongAnyNumber) {
  const ComponentDescriptor& component = LoadPlugin(PLUGIN_FILE).components[0];
  Options options;
  options.only = {"M5"};
  options.case_seconds = 60;
  ExpectLaws({.component = &component, .settings = {{"rate", 0.5, ""}}, .exact_rows = true},
             options);
}

}  // namespace
}  // namespace dreamsearch::check
