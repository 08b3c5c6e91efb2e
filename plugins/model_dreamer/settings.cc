#include "plugins/model_dreamer/settings.h"

#include <vector>

namespace dreamsearch::dreamer {
namespace {

// Sources: [paper] Koul et al. 2020; [dreamer] Hafner et al. 2020 and its code;
// [v2] DreamerV2, Hafner et al. 2021; [v3] DreamerV3, Hafner et al. 2023;
// [ours] chosen here, see README.md.
constexpr ParameterSpec kParameters[] = {
    IntParameter("deterministic", 128, 1, 4096, "units",
                 "Size of the deterministic latent, the GRU's state. [ours; paper: 200]")
        .Preset("paper", 200),
    IntParameter("stochastic", 32, 1, 1024, "units",
                 "Size of the stochastic latent, a diagonal Gaussian. [ours; paper: 30]")
        .Preset("paper", 30),
    IntParameter("hidden", 128, 1, 4096, "units",
                 "Width of every hidden layer and of the embedding. [ours; paper: 200, the "
                 "authors' code]")
        .Preset("paper", 200),
    IntParameter("encoder_layers", 3, 1, 8, "layers",
                 "Layers of the encoder, the last gives the embedding. [dreamer]"),
    IntParameter("decoder_layers", 2, 1, 8, "layers",
                 "Hidden layers of the observation model. [dreamer]"),
    IntParameter("reward_layers", 2, 1, 8, "layers",
                 "Hidden layers of the reward model. [dreamer]"),
    IntParameter("continuation_layers", 3, 1, 8, "layers",
                 "Hidden layers of the continuation model. [dreamer]"),
    IntParameter("actor_layers", 4, 1, 8, "layers", "Hidden layers of the actor. [dreamer]"),
    IntParameter("value_layers", 3, 1, 8, "layers", "Hidden layers of the value. [dreamer]"),
    ChoiceParameter("norm", "none", "none,layer",
                    "Layer normalisation before every ELU; slower, and not better "
                    "(results/published/ablation.md). [v3, MR.Q; Ba et al. 2016]"),

    BoolParameter("normalise_observations", true,
                  "Encode and predict observations standardised by the running mean and variance "
                  "of the training batches. [SimbaV2; Welford 1962]")
        .Preset("paper", false),
    RealParameter("observation_floor", 0.01, 1e-8, 1e3, "",
                  "Least deviation that an observation is divided by. [ours]"),
    RealParameter("observation_clip", 10, 1, 1e6, "deviations",
                  "Standardised observations are clipped to plus and minus this. [ours]"),
    RealParameter("observation_weight", 5, 0, 1e4, "",
                  "Factor of the observation loss; a component of smaller variance than "
                  "kl_scale * kl_posterior_factor over it is not encoded (reverse "
                  "water-filling). [ours; paper: 1]")
        .Preset("paper", 1),
    RealParameter("reward_weight", 50, 0, 1e6, "",
                  "Factor of the reward loss. [ours, as observation_weight; paper: 1]")
        .Preset("paper", 1),
    RealParameter("kl_scale", 1, 0, 1e3, "", "beta, the factor of the KL divergence. [paper]"),
    RealParameter("kl_prior_factor", 1, 0, 10, "",
                  "Factor of the divergence's gradient into the prior. [v3]"),
    RealParameter("kl_posterior_factor", 0.1, 0, 10, "",
                  "Factor of the divergence's gradient into the posterior. [v3: 0.1; paper: 1]")
        .Preset("paper", 1),
    RealParameter("free_nats", 1, 0, 100, "nats",
                  "Divergence up to which the loss is constant. [v3: 1; dreamer: 3]")
        .Preset("paper", 3),
    ChoiceParameter("free_nats_over", "step", "batch,step",
                    "Whether the free nats are granted to the mean over the batch [dreamer] or to "
                    "every step [v3].")
        .Preset("paper", "batch"),
    RealParameter("min_std", 0.1, 1e-4, 1, "",
                  "Least standard deviation of prior and posterior. [dreamer]"),
    BoolParameter("continuation", true,
                  "Where the task has terminal states, learn the chance that an episode continues; "
                  "its mean replaces the discount. [dreamer; paper: never]")
        .Preset("paper", false),
    RealParameter("continuation_scale", 10, 0, 1e3, "",
                  "Factor of the continuation loss. [dreamer]"),
    BoolParameter(
        "zero_heads", true,
        "Start reward, value and continuation at 0 and the actor's output at a hundredth. "
        "[v3]")
        .Preset("paper", false),

    IntParameter("horizon", 12, 1, 100, "decisions", "H, the length of a dream. [ours; paper: 15]")
        .Preset("paper", 15),
    IntParameter("imagination_starts", 128, 0, 1000000, "states",
                 "Posterior states of the batch that dreams start from; 0 for all. [ours; paper: "
                 "all]")
        .Preset("paper", 0),
    IntParameter(
        "start_skip", 4, 0, 1000, "decisions",
        "First steps of a sequence that no dream starts from, while the latent forgets its "
        "zero start; at most length - 1. [ours; paper: 0]")
        .Preset("paper", 0),
    RealParameter("discount", 0.99, 0, 1, "", "gamma, for one decision. [paper]"),
    RealParameter("lambda", 0.95, 0, 1, "", "The mix of the lambda-return. [paper]"),
    RealParameter("actor_mean_limit", 5, 0.1, 100, "",
                  "The actor's mean is limit * tanh(m / limit). [dreamer]"),
    RealParameter("actor_initial_std", 1, 0.01, 20, "",
                  "Standard deviation of the fresh actor before tanh. [ours; dreamer: 5]")
        .Preset("paper", 5),
    RealParameter("actor_min_std", 0.1, 0, 1, "",
                  "Least standard deviation of the actor before tanh. [v3: 0.1; dreamer: 1e-4]")
        .Preset("paper", 1e-4),
    RealParameter(
        "entropy_scale", 3e-3, 0, 10, "",
        "Bonus on the actor's entropy, in units of the return scale. [ours; v3: 3e-4; v2 on "
        "states: 1e-4; paper: 0]")
        .Preset("paper", 0),
    ChoiceParameter("return_scale", "percentile", "none,percentile",
                    "What the actor's returns are divided by: 1, or a moving average of their 5 to "
                    "95 percent range where that is above 1. [v3]")
        .Preset("paper", "none"),
    RealParameter("return_scale_rate", 0.01, 1e-4, 1, "",
                  "Rate of return_scale's moving average, per update. [v3]"),
    RealParameter("value_scale", 100, 0.01, 1e4, "",
                  "The value is this times the network's output, which is fitted in its own units. "
                  "[ours: 1 / (1 - gamma); paper: 1]")
        .Preset("paper", 1),
    RealParameter("slow_critic_weight", 1, 0, 100, "",
                  "Factor of the value's squared distance from its slow copy. [v3; paper: none]")
        .Preset("paper", 0),
    RealParameter("slow_critic_rate", 0.02, 0, 1, "",
                  "How far the slow copy follows the value at each update. [v3]"),
    RealParameter("search_policy_weight", 0.1, 0, 1e3, "",
                  "Factor of the actor's imitation of searches (run.search_targets). [ours]"),
    RealParameter("search_value_weight", 0.25, 0, 1, "",
                  "Share of a search's value in the critic's target of the state searched. [ours]"),

    RealParameter("model_learning_rate", 6e-4, 0, 1, "",
                  "Adam's rate of the world model. [paper: 6e-4]"),
    RealParameter("actor_learning_rate", 3e-4, 0, 1, "",
                  "Adam's rate of the actor. [TD-MPC2: 3e-4; paper: 8e-5]")
        .Preset("paper", 8e-5),
    RealParameter("value_learning_rate", 3e-4, 0, 1, "",
                  "Adam's rate of the value. [TD-MPC2: 3e-4; paper: 8e-5]")
        .Preset("paper", 8e-5),
    RealParameter("adam_beta1", 0.9, 0, 0.9999, "", "Decay of Adam's first moment. [dreamer]"),
    RealParameter("adam_beta2", 0.999, 0, 0.999999, "", "Decay of Adam's second moment. [dreamer]"),
    RealParameter("adam_epsilon", 1e-7, 1e-20, 1, "", "Adam's epsilon. [dreamer]"),
    RealParameter("gradient_clip", 100, 1e-6, 1e9, "",
                  "Largest norm of a group's gradient; longer ones are shortened. [dreamer]"),

    ChoiceParameter("precision", "bfloat16", "float,bfloat16",
                    "Factors of the training's matrix products: float, or rounded to bfloat16 "
                    "where the processor multiplies it (AMX), with float weights and sums. [ours]")
        .Preset("paper", "float"),
    ChoiceParameter(
        "planning_precision", "float", "float,bfloat16",
        "Factors of the matrix products of what planners ask: transitions, rewards, values, "
        "proposals. bfloat16 is faster, but its error of half a percent can be larger than the "
        "differences that a search decides by. The posterior is always in float. "
        "[ours]"),
    ChoiceParameter("acting_latent", "sample", "sample,mean",
                    "What Observe returns of the posterior. [dreamer: sample]"),
    ChoiceParameter("imagined_latent", "mean", "sample,mean",
                    "What Imagine returns of the prior to a planner. [ours: mean, so that equal "
                    "actions give equal returns; training always samples]"),
};

}  // namespace

Settings SettingsFrom(const Parameters& p, bool terminates) {
  Settings s;
  s.deterministic = p.GetInt("deterministic");
  s.stochastic = p.GetInt("stochastic");
  s.hidden = p.GetInt("hidden");
  s.encoder_layers = p.GetInt("encoder_layers");
  s.decoder_layers = p.GetInt("decoder_layers");
  s.reward_layers = p.GetInt("reward_layers");
  s.continuation_layers = p.GetInt("continuation_layers");
  s.actor_layers = p.GetInt("actor_layers");
  s.value_layers = p.GetInt("value_layers");
  s.layer_norm = p.IsChoice("norm", "layer");
  s.normalise_observations = p.GetBool("normalise_observations");
  s.observation_floor = p.GetReal("observation_floor");
  s.observation_clip = p.GetReal("observation_clip");
  s.observation_weight = p.GetReal("observation_weight");
  s.reward_weight = p.GetReal("reward_weight");
  s.kl_scale = p.GetReal("kl_scale");
  s.kl_prior_factor = p.GetReal("kl_prior_factor");
  s.kl_posterior_factor = p.GetReal("kl_posterior_factor");
  s.free_nats = p.GetReal("free_nats");
  s.free_nats_per_step = p.IsChoice("free_nats_over", "step");
  s.min_std = p.GetReal("min_std");
  s.continuation = terminates && p.GetBool("continuation");
  s.continuation_scale = p.GetReal("continuation_scale");
  s.zero_heads = p.GetBool("zero_heads");
  s.horizon = p.GetInt("horizon");
  s.imagination_starts = p.GetInt("imagination_starts");
  s.start_skip = p.GetInt("start_skip");
  s.discount = p.GetReal("discount");
  s.lambda = p.GetReal("lambda");
  s.actor_mean_limit = p.GetReal("actor_mean_limit");
  s.actor_initial_std = p.GetReal("actor_initial_std");
  s.actor_min_std = p.GetReal("actor_min_std");
  s.entropy_scale = p.GetReal("entropy_scale");
  s.percentile_return_scale = p.IsChoice("return_scale", "percentile");
  s.return_scale_rate = p.GetReal("return_scale_rate");
  s.value_scale = p.GetReal("value_scale");
  s.slow_critic_weight = p.GetReal("slow_critic_weight");
  s.slow_critic_rate = p.GetReal("slow_critic_rate");
  s.search_policy_weight = p.GetReal("search_policy_weight");
  s.search_value_weight = p.GetReal("search_value_weight");
  s.model_learning_rate = p.GetReal("model_learning_rate");
  s.actor_learning_rate = p.GetReal("actor_learning_rate");
  s.value_learning_rate = p.GetReal("value_learning_rate");
  s.adam_beta1 = p.GetReal("adam_beta1");
  s.adam_beta2 = p.GetReal("adam_beta2");
  s.adam_epsilon = p.GetReal("adam_epsilon");
  s.gradient_clip = p.GetReal("gradient_clip");
  s.bfloat16 = p.IsChoice("precision", "bfloat16");
  s.bfloat16_planning = p.IsChoice("planning_precision", "bfloat16");
  s.acting_latent_sample = p.IsChoice("acting_latent", "sample");
  s.imagined_latent_sample = p.IsChoice("imagined_latent", "sample");
  return s;
}

View<const ParameterSpec> DeclaredParameters() {
  return {kParameters, sizeof kParameters / sizeof *kParameters};
}

Settings PresetSettings(const char* preset) {
  const std::vector<ParameterValue> values = ValuesUnder(DeclaredParameters(), preset);
  return SettingsFrom({{values.data(), values.size()}}, false);
}

}  // namespace dreamsearch::dreamer
