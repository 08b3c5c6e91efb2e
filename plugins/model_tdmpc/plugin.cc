// The plugin model_tdmpc: one component, the model `tdmpc`.
#include "dreamsearch/plugin.h"

#include "plugins/model_tdmpc/tdmpc.h"

namespace {

using dreamsearch::ComponentDescriptor;
using dreamsearch::ComponentKind;
using dreamsearch::RunPreset;

// TD-MPC2's batches of 256 sequences with 3 steps, an update after each decision at action repeat
// 2, and as many before the first episode as there are random decisions.
constexpr RunPreset kRunPresets[] = {
    {"batch_size", "fast", 256},         {"batch_size", "paper", 256},
    {"sequence_length", "fast", 4},      {"sequence_length", "paper", 4},
    {"train_every", "fast", 2},          {"train_every", "paper", 2},
    {"pretrain_updates", "fast", 2500},  {"pretrain_updates", "paper", 2500},
    {"train_within_episode", "fast", 1}, {"train_within_episode", "paper", 1},
    {"exploration_hold", "fast", 1},     {"exploration_hold", "paper", 1},
};

const ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kModel,
    .traits = dreamsearch::kLearns | dreamsearch::kLearnsFromSearch | dreamsearch::kGivesGradients,
    .name = "tdmpc",
    .version = DREAMSEARCH_VERSION,
    .summary = "decoder-free latent model with an ensemble of critics, for planning (TD-MPC2)",
    .parameters = dreamsearch::tdmpc::DeclaredParameters(),
    .metrics = dreamsearch::ViewOf(dreamsearch::tdmpc::kMetrics),
    .run_presets = dreamsearch::ViewOf(kRunPresets),
    .create_model = dreamsearch::tdmpc::CreateTdmpc,
}};

}  // namespace

DREAMSEARCH_PLUGIN("model_tdmpc", DREAMSEARCH_VERSION, kComponents)
