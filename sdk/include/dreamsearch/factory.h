// factory.h - factories that turn exceptions into a Status.
//
//     .create_planner = CreatePlanner<MyPlanner>
//
// for a class with a constructor from PlannerContext that throws std::invalid_argument for
// settings that do not go together; likewise for models and environments. Nothing here crosses
// the plugin boundary: a component may write its factory by hand.
#pragma once

#include <exception>
#include <stdexcept>

#include "dreamsearch/plugin.h"

namespace dreamsearch {

namespace factory_internal {

template <typename T, typename Context, typename Interface>
Status Create(const char* kind, const Context& context, Interface** result) noexcept {
  *result = nullptr;
  try {
    *result = new T(context);
    return OkStatus();
  } catch (const std::invalid_argument& error) {
    return Error(StatusCode::kInvalidArgument, "%s", error.what());
  } catch (const std::exception& error) {
    return Error(StatusCode::kInternal, "cannot make the %s: %s", kind, error.what());
  }
}

}  // namespace factory_internal

template <typename T>
Status CreateEnvironment(const EnvironmentContext& context, Environment** result) noexcept {
  return factory_internal::Create<T>("environment", context, result);
}

template <typename T>
Status CreateModel(const ModelContext& context, Model** result) noexcept {
  return factory_internal::Create<T>("model", context, result);
}

template <typename T>
Status CreatePlanner(const PlannerContext& context, Planner** result) noexcept {
  return factory_internal::Create<T>("planner", context, result);
}

}  // namespace dreamsearch
