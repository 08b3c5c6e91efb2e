#include "plugins/model_tdmpc/settings.h"

#include <vector>

namespace dreamsearch::tdmpc {
namespace {

// Sources: [paper] TD-MPC2, Hansen et al. 2024, and its code; [SimbaV2] Lee et al. 2025;
// [ours] chosen here, see README.md.
constexpr ParameterSpec kParameters[] = {
    IntParameter("simplices", 16, 1, 512, "",
                 "Softmaxes in the latent, of 8 numbers each. [ours; paper: 64]")
        .Preset("paper", 64),
    IntParameter("encoder_width", 128, 1, 4096, "units",
                 "Width of the encoder's hidden layers. [ours; paper: 256]")
        .Preset("paper", 256),
    IntParameter("encoder_layers", 1, 1, 8, "layers",
                 "Hidden layers of the encoder, before the layer that gives the latent. [paper]"),
    IntParameter("width", 128, 1, 4096, "units",
                 "Width of the hidden layers of dynamics, reward, critics and actor. [ours; paper: "
                 "512]")
        .Preset("paper", 512),
    IntParameter("layers", 2, 1, 8, "layers",
                 "Hidden layers of dynamics, reward, critics and actor. [paper]"),
    IntParameter("critics", 2, 1, 16, "",
                 "Q functions in the ensemble, all trained. [ours; paper: 5]")
        .Preset("paper", 5),
    IntParameter("bins", 101, 2, 1001, "",
                 "Bins of the distributions that give rewards and values. [paper]"),
    RealParameter(
        "bin_range", 10, 0.1, 100, "",
        "The bins lie evenly in symlog space from minus to plus this; targets are clipped "
        "to the range. [paper]"),

    BoolParameter("normalise_observations", true,
                  "Encode observations standardised by the running mean and variance of the "
                  "training batches. [SimbaV2]")
        .Preset("paper", false),
    RealParameter("observation_floor", 0.01, 1e-8, 1e3, "",
                  "Least deviation that an observation is divided by. [ours]"),
    RealParameter("observation_clip", 10, 1, 1e6, "deviations",
                  "Standardised observations are clipped to plus and minus this. [ours]"),
    RealParameter("rho", 0.5, 0, 1, "",
                  "Weight of a step's losses relative to those of the step before it. [paper]"),
    RealParameter("consistency_weight", 20, 0, 1e4, "",
                  "Factor of the squared distance of imagined from encoded latents. [paper]"),
    RealParameter("reward_weight", 0.1, 0, 1e4, "", "Factor of the reward loss. [paper]"),
    RealParameter("value_weight", 0.1, 0, 1e4, "", "Factor of the critics' loss. [paper]"),
    RealParameter("continuation_weight", 1, 0, 1e4, "",
                  "Factor of the continuation loss, from the first batch on in which an episode "
                  "ends early. [paper]"),
    RealParameter("discount", 0.99, 0, 1, "",
                  "Discount gamma of one decision. [paper: 0.99 for episodes of 500 decisions]"),
    ChoiceParameter("target", "two", "two,all",
                    "The critics whose least value is the target: two drawn for each update "
                    "[paper], or all of them."),
    RealParameter("target_rate", 0.01, 0, 1, "",
                  "How far the target critics follow the critics at each update. [paper]"),
    RealParameter("min_log_std", -10, -20, 0, "",
                  "Least logarithm of the actor's deviation before tanh. [paper]"),
    RealParameter("max_log_std", 2, 0.01, 5, "", "Largest logarithm of it. [paper]"),
    RealParameter("entropy_scale", 1e-4, 0, 10, "",
                  "Bonus on the actor's entropy, for each action component, in units of the "
                  "return scale. [paper]"),
    RealParameter("return_scale_rate", 0.01, 1e-4, 1, "",
                  "Rate of the moving average of the values' 5 to 95 percent range, which the "
                  "actor's values are divided by. [paper]"),
    RealParameter("search_policy_weight", 0.1, 0, 1e3, "",
                  "Factor of the actor's imitation of searches (run.search_targets). [ours]"),
    RealParameter("search_value_weight", 0.25, 0, 1, "",
                  "Share of a search's value in the critic's target of the state searched. [ours]"),

    RealParameter("learning_rate", 3e-4, 0, 1, "",
                  "Adam's rate of dynamics, reward, continuation and critics. [paper]"),
    RealParameter("encoder_rate_factor", 0.3, 0, 10, "",
                  "The encoder's rate, as a factor of learning_rate. [paper]"),
    RealParameter("actor_learning_rate", 3e-4, 0, 1, "", "Adam's rate of the actor. [paper]"),
    RealParameter("adam_epsilon", 1e-8, 1e-20, 1, "", "Adam's epsilon. [paper]"),
    RealParameter("actor_adam_epsilon", 1e-5, 1e-20, 1, "", "The same for the actor. [paper]"),
    RealParameter("gradient_clip", 20, 1e-6, 1e9, "",
                  "Largest norm of the actor's gradient, and of that of all others together. "
                  "[paper]"),
    ChoiceParameter("precision", "float", "float,bfloat16",
                    "Factors of the training's matrix products: float, or rounded to bfloat16 "
                    "where the processor multiplies it (AMX), with float weights and sums. [ours]"),
    ChoiceParameter(
        "planning_precision", "float", "float,bfloat16",
        "Factors of the matrix products of what planners ask: transitions, rewards, values, "
        "proposals. [ours]"),
};

}  // namespace

Settings SettingsFrom(const Parameters& p) {
  Settings s;
  s.latent = kSimplex * p.GetInt("simplices");
  s.encoder_width = p.GetInt("encoder_width");
  s.encoder_layers = p.GetInt("encoder_layers");
  s.width = p.GetInt("width");
  s.layers = p.GetInt("layers");
  s.critics = p.GetInt("critics");
  s.bins = {p.GetInt("bins"), -p.GetReal("bin_range"), p.GetReal("bin_range")};
  s.normalise_observations = p.GetBool("normalise_observations");
  s.observation_floor = p.GetReal("observation_floor");
  s.observation_clip = p.GetReal("observation_clip");
  s.rho = p.GetReal("rho");
  s.consistency_weight = p.GetReal("consistency_weight");
  s.reward_weight = p.GetReal("reward_weight");
  s.value_weight = p.GetReal("value_weight");
  s.continuation_weight = p.GetReal("continuation_weight");
  s.discount = p.GetReal("discount");
  s.target_of_all = p.IsChoice("target", "all");
  s.target_rate = p.GetReal("target_rate");
  s.min_log_std = p.GetReal("min_log_std");
  s.max_log_std = p.GetReal("max_log_std");
  s.entropy_scale = p.GetReal("entropy_scale");
  s.return_scale_rate = p.GetReal("return_scale_rate");
  s.search_policy_weight = p.GetReal("search_policy_weight");
  s.search_value_weight = p.GetReal("search_value_weight");
  s.learning_rate = p.GetReal("learning_rate");
  s.encoder_rate_factor = p.GetReal("encoder_rate_factor");
  s.actor_learning_rate = p.GetReal("actor_learning_rate");
  s.adam_epsilon = p.GetReal("adam_epsilon");
  s.actor_adam_epsilon = p.GetReal("actor_adam_epsilon");
  s.gradient_clip = p.GetReal("gradient_clip");
  s.bfloat16 = p.IsChoice("precision", "bfloat16");
  s.bfloat16_planning = p.IsChoice("planning_precision", "bfloat16");
  return s;
}

View<const ParameterSpec> DeclaredParameters() {
  return {kParameters, sizeof kParameters / sizeof *kParameters};
}

Settings PresetSettings(const char* preset) {
  const std::vector<ParameterValue> values = ValuesUnder(DeclaredParameters(), preset);
  return SettingsFrom({{values.data(), values.size()}});
}

}  // namespace dreamsearch::tdmpc
