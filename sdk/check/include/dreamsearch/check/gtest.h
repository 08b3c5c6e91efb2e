// gtest.h - the laws as tests of GoogleTest: one test for each component of a plugin.
//
//   #include "dreamsearch/check/gtest.h"
//   DREAMSEARCH_CHECK_PLUGIN(MyPlanner, MY_PLUGIN_FILE)
//
// For settings, levels or limits of your own call ExpectLaws in a test of your own.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "dreamsearch/check/check.h"

namespace dreamsearch::check {

// Adds a failure for each law that the subject does not keep.
inline void ExpectLaws(const Subject& subject, Options options = {}) {
  for (const Outcome& outcome : Check(subject, options)) {
    if (!outcome.good()) ADD_FAILURE() << subject.component->name << ": " << Describe(outcome);
  }
}

}  // namespace dreamsearch::check

#define DREAMSEARCH_CHECK_PLUGIN(suite, file)                                      \
  TEST(suite, KeepsTheLawsOfItsKind) {                                             \
    for (const ::dreamsearch::ComponentDescriptor& component :                     \
         ::dreamsearch::check::LoadPlugin(file).components) {                      \
      ::dreamsearch::check::ExpectLaws({.component = &component, .settings = {}}); \
    }                                                                              \
  }
