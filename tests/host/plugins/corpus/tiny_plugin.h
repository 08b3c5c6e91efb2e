// tiny_plugin.h - the smallest plugin there is, for libraries that are wrong in
// one way. Each includes this and exports a descriptor of its own making.
#pragma once

#include "dreamsearch/plugin.h"

namespace dreamsearch {

inline Status MakeNoPlanner(const PlannerContext&, Planner** result) noexcept {
  *result = nullptr;
  return Error(StatusCode::kUnimplemented, "this planner is for tests of the loader");
}

constexpr ComponentDescriptor TinyPlanner(const char* name) {
  ComponentDescriptor component;
  component.kind = ComponentKind::kPlanner;
  component.name = name;
  component.version = "1.0.0";
  component.summary = "A planner for tests of the loader.";
  component.create_planner = MakeNoPlanner;
  return component;
}

// The file's name is the component's, so that a test finds it by either.
#define TINY_PLUGIN(name)                                                                       \
  namespace {                                                                                   \
  constexpr dreamsearch::ComponentDescriptor kComponents[] = {dreamsearch::TinyPlanner(#name)}; \
  }                                                                                             \
  DREAMSEARCH_PLUGIN(#name, "1.0.0", kComponents)

// A descriptor with fields changed: TINY_DESCRIPTOR(dreamsearch_sdk_1, d.sdk_minor = 9)
#define TINY_DESCRIPTOR(entry, change)                                                             \
  namespace {                                                                                      \
  constexpr dreamsearch::ComponentDescriptor kComponents[] = {dreamsearch::TinyPlanner("tiny")};   \
  constexpr dreamsearch::PluginDescriptor MakeDescriptor() {                                       \
    dreamsearch::PluginDescriptor d;                                                               \
    d.name = "tiny";                                                                               \
    d.version = "1.0.0";                                                                           \
    d.components = dreamsearch::ViewOf(kComponents);                                               \
    change;                                                                                        \
    return d;                                                                                      \
  }                                                                                                \
  constexpr dreamsearch::PluginDescriptor kDescriptor = MakeDescriptor();                          \
  }                                                                                                \
  extern "C" __attribute__((visibility("default"))) const dreamsearch::PluginDescriptor* entry() { \
    return &kDescriptor;                                                                           \
  }

// Runs a statement while the library is loaded.
#define WHILE_LOADING(statement) \
  namespace {                    \
  const int initialiser = [] {   \
    statement;                   \
    return 0;                    \
  }();                           \
  }

}  // namespace dreamsearch
