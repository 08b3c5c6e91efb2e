// plugin.cc - offers every task of tasks.h as an environment component.
#include "dreamsearch/plugin.h"

#include <array>
#include <exception>
#include <iterator>
#include <memory>
#include <utility>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

template <std::size_t I>
Status Create(const EnvironmentContext& context, Environment** result) noexcept {
  *result = nullptr;
  try {
    std::unique_ptr<ControlTask> task(kTasks[I].make());
    task->Vary(mujoco::Variation::From(context.parameters, context.action_repeat));
    *result = task.release();
    return OkStatus();
  } catch (const std::exception& error) {
    return Error(StatusCode::kInternal, "%s: %s", kTasks[I].name, error.what());
  }
}

template <std::size_t... I>
constexpr auto MakeComponents(std::index_sequence<I...>) {
  return std::array<ComponentDescriptor, sizeof...(I)>{
      ComponentDescriptor{.kind = ComponentKind::kEnvironment,
                          .name = kTasks[I].name,
                          .aliases = kTasks[I].aliases,
                          .version = "1.0.0",
                          .summary = kTasks[I].summary,
                          .parameters = mujoco::kVariationSettings.declared(),
                          .create_environment = Create<I>}...};
}

constexpr auto kComponentArray = MakeComponents(std::make_index_sequence<std::size(kTasks)>());
constexpr auto& kComponents = kComponentArray._M_elems;

}  // namespace
}  // namespace dreamsearch::dmc

DREAMSEARCH_PLUGIN("env_dmc", "1.0.0", dreamsearch::dmc::kComponents)
