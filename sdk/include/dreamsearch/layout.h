// layout.h - where SDK 1.0 has the fields of what crosses the boundary. Included by plugin.h.
//
// Fixed for all of 1.x: a field that comes later is not listed (version.h says where it goes). A
// plugin that is compiled with flags that change the layout of structs (-fpack-struct and the
// like) does not compile, instead of reading other memory than the host wrote.
#pragma once

#include <cstddef>
#include <cstdint>

#include "dreamsearch/plugin.h"

namespace dreamsearch {

// The size of a struct in SDK 1.0: none that crosses is shorter.
template <typename Struct>
inline constexpr std::uint64_t kFirstSize = 0;

#define DREAMSEARCH_AT(type, field, offset)                              \
  static_assert(offsetof(type, field) == (offset),                       \
                #type "::" #field                                        \
                      " does not lie where SDK 1.0 has it: compile the " \
                      "plugin without flags that change the layout of structs")
#define DREAMSEARCH_FIRST_SIZE(type, size)                  \
  template <>                                               \
  inline constexpr std::uint64_t kFirstSize<type> = (size); \
  static_assert(sizeof(type) >= (size) && sizeof(type) % 8 == 0)

// Structs with their size, in struct_size.
DREAMSEARCH_AT(EnvironmentSpec, observation, 0);
DREAMSEARCH_AT(EnvironmentSpec, observation_size, 24);
DREAMSEARCH_AT(EnvironmentSpec, action_size, 32);
DREAMSEARCH_AT(EnvironmentSpec, action_low, 40);
DREAMSEARCH_AT(EnvironmentSpec, action_high, 56);
DREAMSEARCH_AT(EnvironmentSpec, control_seconds, 72);
DREAMSEARCH_AT(EnvironmentSpec, substeps, 80);
DREAMSEARCH_AT(EnvironmentSpec, episode_steps, 84);
DREAMSEARCH_AT(EnvironmentSpec, terminates, 88);
DREAMSEARCH_AT(EnvironmentSpec, return_low, 96);
DREAMSEARCH_AT(EnvironmentSpec, return_high, 104);
DREAMSEARCH_AT(EnvironmentSpec, ingredients, 112);
DREAMSEARCH_AT(EnvironmentSpec, notice, 136);
DREAMSEARCH_AT(EnvironmentSpec, struct_size, 144);
DREAMSEARCH_FIRST_SIZE(EnvironmentSpec, 152);

DREAMSEARCH_AT(StepResult, reward, 0);
DREAMSEARCH_AT(StepResult, discount, 8);
DREAMSEARCH_AT(StepResult, last, 16);
DREAMSEARCH_AT(StepResult, struct_size, 24);
DREAMSEARCH_FIRST_SIZE(StepResult, 32);

DREAMSEARCH_AT(RenderRequest, width, 0);
DREAMSEARCH_AT(RenderRequest, height, 4);
DREAMSEARCH_AT(RenderRequest, camera, 8);
DREAMSEARCH_AT(RenderRequest, struct_size, 16);
DREAMSEARCH_FIRST_SIZE(RenderRequest, 24);

DREAMSEARCH_AT(ImagineRequest, latents, 0);
DREAMSEARCH_AT(ImagineRequest, actions, 24);
DREAMSEARCH_AT(ImagineRequest, seeds, 48);
DREAMSEARCH_AT(ImagineRequest, struct_size, 64);
DREAMSEARCH_FIRST_SIZE(ImagineRequest, 72);

DREAMSEARCH_AT(ImagineResult, latents, 0);
DREAMSEARCH_AT(ImagineResult, rewards, 24);
DREAMSEARCH_AT(ImagineResult, discounts, 40);
DREAMSEARCH_AT(ImagineResult, struct_size, 56);
DREAMSEARCH_FIRST_SIZE(ImagineResult, 64);

DREAMSEARCH_AT(SpreadResult, values, 0);
DREAMSEARCH_AT(SpreadResult, deviations, 16);
DREAMSEARCH_AT(SpreadResult, least, 32);
DREAMSEARCH_AT(SpreadResult, struct_size, 48);
DREAMSEARCH_FIRST_SIZE(SpreadResult, 56);

DREAMSEARCH_AT(GradientRequest, latents, 0);
DREAMSEARCH_AT(GradientRequest, actions, 24);
DREAMSEARCH_AT(GradientRequest, seeds, 48);
DREAMSEARCH_AT(GradientRequest, deviations, 64);
DREAMSEARCH_AT(GradientRequest, least, 72);
DREAMSEARCH_AT(GradientRequest, struct_size, 80);
DREAMSEARCH_FIRST_SIZE(GradientRequest, 88);

DREAMSEARCH_AT(GradientResult, returns, 0);
DREAMSEARCH_AT(GradientResult, gradients, 16);
DREAMSEARCH_AT(GradientResult, struct_size, 40);
DREAMSEARCH_FIRST_SIZE(GradientResult, 48);

DREAMSEARCH_AT(ObserveRequest, previous, 0);
DREAMSEARCH_AT(ObserveRequest, actions, 24);
DREAMSEARCH_AT(ObserveRequest, observations, 48);
DREAMSEARCH_AT(ObserveRequest, environment_states, 72);
DREAMSEARCH_AT(ObserveRequest, seeds, 96);
DREAMSEARCH_AT(ObserveRequest, struct_size, 112);
DREAMSEARCH_FIRST_SIZE(ObserveRequest, 120);

DREAMSEARCH_AT(SequenceBatch, sequences, 0);
DREAMSEARCH_AT(SequenceBatch, length, 8);
DREAMSEARCH_AT(SequenceBatch, observations, 16);
DREAMSEARCH_AT(SequenceBatch, actions, 40);
DREAMSEARCH_AT(SequenceBatch, rewards, 64);
DREAMSEARCH_AT(SequenceBatch, discounts, 80);
DREAMSEARCH_AT(SequenceBatch, is_first, 96);
DREAMSEARCH_AT(SequenceBatch, search_candidates, 112);
DREAMSEARCH_AT(SequenceBatch, search_actions, 120);
DREAMSEARCH_AT(SequenceBatch, search_weights, 144);
DREAMSEARCH_AT(SequenceBatch, search_values, 160);
DREAMSEARCH_AT(SequenceBatch, struct_size, 176);
DREAMSEARCH_FIRST_SIZE(SequenceBatch, 184);

DREAMSEARCH_AT(TrainRequest, batch, 0);
DREAMSEARCH_AT(TrainRequest, seed, 8);
DREAMSEARCH_AT(TrainRequest, update, 16);
DREAMSEARCH_AT(TrainRequest, environment_step, 24);
DREAMSEARCH_AT(TrainRequest, struct_size, 32);
DREAMSEARCH_FIRST_SIZE(TrainRequest, 40);

DREAMSEARCH_AT(PlanRequest, root, 0);
DREAMSEARCH_AT(PlanRequest, explore, 24);
DREAMSEARCH_AT(PlanRequest, seed, 32);
DREAMSEARCH_AT(PlanRequest, decision, 40);
DREAMSEARCH_AT(PlanRequest, environment_step, 48);
DREAMSEARCH_AT(PlanRequest, struct_size, 56);
DREAMSEARCH_FIRST_SIZE(PlanRequest, 64);

DREAMSEARCH_AT(PlanResult, action, 0);
DREAMSEARCH_AT(PlanResult, metrics, 16);
DREAMSEARCH_AT(PlanResult, value, 32);
DREAMSEARCH_AT(PlanResult, simulations, 40);
DREAMSEARCH_AT(PlanResult, nodes, 44);
DREAMSEARCH_AT(PlanResult, depth, 48);
DREAMSEARCH_AT(PlanResult, struct_size, 56);
DREAMSEARCH_FIRST_SIZE(PlanResult, 64);

DREAMSEARCH_AT(TreeEdge, parent, 0);
DREAMSEARCH_AT(TreeEdge, action, 8);
DREAMSEARCH_AT(TreeEdge, visits, 24);
DREAMSEARCH_AT(TreeEdge, q, 32);
DREAMSEARCH_AT(TreeEdge, prior, 40);
DREAMSEARCH_AT(TreeEdge, reward, 48);
DREAMSEARCH_AT(TreeEdge, discount, 56);
DREAMSEARCH_AT(TreeEdge, value, 64);
DREAMSEARCH_AT(TreeEdge, expanded, 72);
DREAMSEARCH_AT(TreeEdge, struct_size, 80);
DREAMSEARCH_FIRST_SIZE(TreeEdge, 88);

DREAMSEARCH_AT(EnvironmentContext, parameters, 0);
DREAMSEARCH_AT(EnvironmentContext, action_repeat, 24);
DREAMSEARCH_AT(EnvironmentContext, struct_size, 32);
DREAMSEARCH_FIRST_SIZE(EnvironmentContext, 40);

DREAMSEARCH_AT(ModelContext, parameters, 0);
DREAMSEARCH_AT(ModelContext, observation_size, 24);
DREAMSEARCH_AT(ModelContext, action_size, 32);
DREAMSEARCH_AT(ModelContext, action_repeat, 40);
DREAMSEARCH_AT(ModelContext, episode_decisions, 44);
DREAMSEARCH_AT(ModelContext, terminates, 48);
DREAMSEARCH_AT(ModelContext, seed, 56);
DREAMSEARCH_AT(ModelContext, environment, 64);
DREAMSEARCH_AT(ModelContext, trained_model, 72);
DREAMSEARCH_AT(ModelContext, struct_size, 80);
DREAMSEARCH_FIRST_SIZE(ModelContext, 88);

DREAMSEARCH_AT(PlannerContext, parameters, 0);
DREAMSEARCH_AT(PlannerContext, action_size, 24);
DREAMSEARCH_AT(PlannerContext, latent_bytes, 32);
DREAMSEARCH_AT(PlannerContext, struct_size, 40);
DREAMSEARCH_FIRST_SIZE(PlannerContext, 48);

DREAMSEARCH_AT(PluginDescriptor, magic, 0);
DREAMSEARCH_AT(PluginDescriptor, sdk_major, 8);
DREAMSEARCH_AT(PluginDescriptor, sdk_minor, 12);
DREAMSEARCH_AT(PluginDescriptor, struct_size, 16);
DREAMSEARCH_AT(PluginDescriptor, name, 24);
DREAMSEARCH_AT(PluginDescriptor, version, 32);
DREAMSEARCH_AT(PluginDescriptor, components, 40);
DREAMSEARCH_FIRST_SIZE(PluginDescriptor, 64);

// Elements of Records.
DREAMSEARCH_AT(ParameterSpec, name, 0);
DREAMSEARCH_AT(ParameterSpec, type, 8);
DREAMSEARCH_AT(ParameterSpec, preset_count, 12);
DREAMSEARCH_AT(ParameterSpec, default_number, 16);
DREAMSEARCH_AT(ParameterSpec, min, 24);
DREAMSEARCH_AT(ParameterSpec, max, 32);
DREAMSEARCH_AT(ParameterSpec, default_choice, 40);
DREAMSEARCH_AT(ParameterSpec, choices, 48);
DREAMSEARCH_AT(ParameterSpec, unit, 56);
DREAMSEARCH_AT(ParameterSpec, help, 64);
DREAMSEARCH_AT(ParameterSpec, variation, 72);
DREAMSEARCH_AT(ParameterSpec, presets, 80);
DREAMSEARCH_FIRST_SIZE(ParameterSpec, 176);

DREAMSEARCH_AT(ParameterValue, name, 0);
DREAMSEARCH_AT(ParameterValue, number, 8);
DREAMSEARCH_AT(ParameterValue, choice, 16);
DREAMSEARCH_FIRST_SIZE(ParameterValue, 24);

DREAMSEARCH_AT(MetricSpec, name, 0);
DREAMSEARCH_AT(MetricSpec, unit, 8);
DREAMSEARCH_AT(MetricSpec, help, 16);
DREAMSEARCH_FIRST_SIZE(MetricSpec, 24);

DREAMSEARCH_AT(ObservationPart, name, 0);
DREAMSEARCH_AT(ObservationPart, size, 8);
DREAMSEARCH_FIRST_SIZE(ObservationPart, 16);

DREAMSEARCH_AT(Ingredient, name, 0);
DREAMSEARCH_AT(Ingredient, value, 8);
DREAMSEARCH_FIRST_SIZE(Ingredient, 16);

DREAMSEARCH_AT(RunPreset, name, 0);
DREAMSEARCH_AT(RunPreset, preset, 8);
DREAMSEARCH_AT(RunPreset, number, 16);
DREAMSEARCH_FIRST_SIZE(RunPreset, 24);

DREAMSEARCH_AT(ComponentDescriptor, kind, 0);
DREAMSEARCH_AT(ComponentDescriptor, traits, 4);
DREAMSEARCH_AT(ComponentDescriptor, name, 8);
DREAMSEARCH_AT(ComponentDescriptor, aliases, 16);
DREAMSEARCH_AT(ComponentDescriptor, version, 24);
DREAMSEARCH_AT(ComponentDescriptor, summary, 32);
DREAMSEARCH_AT(ComponentDescriptor, parameters, 40);
DREAMSEARCH_AT(ComponentDescriptor, metrics, 64);
DREAMSEARCH_AT(ComponentDescriptor, run_presets, 88);
DREAMSEARCH_AT(ComponentDescriptor, task_parameter, 112);
DREAMSEARCH_AT(ComponentDescriptor, create_environment, 120);
DREAMSEARCH_AT(ComponentDescriptor, create_model, 128);
DREAMSEARCH_AT(ComponentDescriptor, create_planner, 136);
DREAMSEARCH_FIRST_SIZE(ComponentDescriptor, 144);

// Frozen.
static_assert(sizeof(View<double>) == 16);
static_assert(sizeof(MatrixView<double>) == 24);
static_assert(sizeof(Records<MetricSpec>) == 24);

DREAMSEARCH_AT(Status, code, 0);
DREAMSEARCH_AT(Status, message, 4);
static_assert(sizeof(Status) == 256);

DREAMSEARCH_AT(PresetValue, preset, 0);
DREAMSEARCH_AT(PresetValue, number, 8);
DREAMSEARCH_AT(PresetValue, choice, 16);
static_assert(sizeof(PresetValue) == 24);

DREAMSEARCH_AT(Parameters, values, 0);
static_assert(sizeof(Parameters) == 24);

#undef DREAMSEARCH_AT
#undef DREAMSEARCH_FIRST_SIZE

}  // namespace dreamsearch
