#include "plugins/model_dreamer/settings.h"

#include <vector>

namespace dreamsearch::dreamer {
namespace {

// Sources: [paper] Koul et al. 2020; [dreamer] Hafner et al. 2020 and its code;
// [v2] DreamerV2, Hafner et al. 2021; [v3] DreamerV3, Hafner et al. 2023;
// [MRS.Q] arXiv 2601.21306;
// [ours] chosen here, see README.md.
constexpr auto kSettings = BindSettings<Settings>(
    Bind<&Settings::deterministic>(
        IntParameter("deterministic", 128, 1, 4096, "units",
                     "Size of the deterministic latent, the GRU's state. [ours; paper: 200]")
            .Preset("paper", 200)),
    Bind<&Settings::stochastic>(
        IntParameter("stochastic", 32, 1, 1024, "units",
                     "Size of the stochastic latent, a diagonal Gaussian. [ours; paper: 30]")
            .Preset("paper", 30)),
    Bind<&Settings::hidden>(
        IntParameter("hidden", 128, 1, 4096, "units",
                     "Width of every hidden layer and of the embedding. [ours; paper: 200, the "
                     "authors' code]")
            .Preset("paper", 200)),
    Bind<&Settings::encoder_layers>(
        IntParameter("encoder_layers", 3, 1, 8, "layers",
                     "Layers of the encoder, the last gives the embedding. [dreamer]")),
    Bind<&Settings::decoder_layers>(IntParameter(
        "decoder_layers", 2, 1, 8, "layers", "Hidden layers of the observation model. [dreamer]")),
    Bind<&Settings::reward_layers>(IntParameter("reward_layers", 2, 1, 8, "layers",
                                                "Hidden layers of the reward model. [dreamer]")),
    Bind<&Settings::continuation_layers>(
        IntParameter("continuation_layers", 3, 1, 8, "layers",
                     "Hidden layers of the continuation model. [dreamer]")),
    Bind<&Settings::actor_layers>(
        IntParameter("actor_layers", 2, 1, 8, "layers",
                     "Hidden layers of the actor. [TD-MPC2: 2; dreamer, paper: 4]")
            .Preset("paper", 4)),
    Bind<&Settings::value_layers>(
        IntParameter("value_layers", 2, 1, 8, "layers",
                     "Hidden layers of the value. [TD-MPC2: 2; dreamer, paper: 3]")
            .Preset("paper", 3)),
    Bind<&Settings::critics>(
        IntParameter("critics", 1, 1, 16, "",
                     "Values in the ensemble, all trained; planners see its mean, deviation and "
                     "least. [MRS.Q: 10; paper: 1]")),
    Bind<&Settings::layer_norm>(
        ChoiceParameter("norm", "none", "none,layer",
                        "Layer normalisation before every ELU; slower, and not better "
                        "(results/published/ablation.md). [v3, MR.Q; Ba et al. 2016]")),

    Bind<&Settings::normalise_observations>(
        BoolParameter(
            "normalise_observations", true,
            "Encode and predict observations standardised by the running mean and variance "
            "of the training batches. [SimbaV2; Welford 1962]")
            .Preset("paper", false)),
    kObservationFloorParameter, kObservationClipParameter,
    Bind<&Settings::observation_weight>(
        RealParameter("observation_weight", 5, 0, 1e4, "",
                      "Factor of the observation loss; a component of smaller variance than "
                      "kl_scale * kl_posterior_factor over it is not encoded (reverse "
                      "water-filling). [ours; paper: 1]")
            .Preset("paper", 1)),
    Bind<&Settings::reward_weight>(
        RealParameter("reward_weight", 50, 0, 1e6, "",
                      "Factor of the reward loss. [ours, as observation_weight; paper: 1]")
            .Preset("paper", 1)),
    Bind<&Settings::kl_scale>(
        RealParameter("kl_scale", 1, 0, 1e3, "", "beta, the factor of the KL divergence. [paper]")),
    Bind<&Settings::kl_prior_factor>(
        RealParameter("kl_prior_factor", 1, 0, 10, "",
                      "Factor of the divergence's gradient into the prior. [v3]")),
    Bind<&Settings::kl_posterior_factor>(
        RealParameter("kl_posterior_factor", 0.1, 0, 10, "",
                      "Factor of the divergence's gradient into the posterior. [v3: 0.1; paper: 1]")
            .Preset("paper", 1)),
    Bind<&Settings::free_nats>(
        RealParameter("free_nats", 1, 0, 100, "nats",
                      "Divergence up to which the loss is constant. [v3: 1; dreamer: 3]")
            .Preset("paper", 3)),
    Bind<&Settings::free_nats_per_step>(
        ChoiceParameter(
            "free_nats_over", "step", "batch,step",
            "Whether the free nats are granted to the mean over the batch [dreamer] or to "
            "every step [v3].")
            .Preset("paper", "batch")),
    Bind<&Settings::min_std>(RealParameter(
        "min_std", 0.1, 1e-4, 1, "", "Least standard deviation of prior and posterior. [dreamer]")),
    Bind<&Settings::continuation>(
        BoolParameter(
            "continuation", true,
            "Where the task has terminal states, learn the chance that an episode continues; "
            "its mean replaces the discount. [dreamer; paper: never]")
            .Preset("paper", false)),
    Bind<&Settings::continuation_scale>(RealParameter(
        "continuation_scale", 10, 0, 1e3, "", "Factor of the continuation loss. [dreamer]")),
    Bind<&Settings::zero_heads>(
        BoolParameter(
            "zero_heads", true,
            "Start reward, value and continuation at 0 and the actor's output at a hundredth. "
            "[v3]")
            .Preset("paper", false)),

    Bind<&Settings::horizon>(IntParameter("horizon", 8, 1, 100, "decisions",
                                          "H, the length of a dream. [ours; paper: 15]")
                                 .Preset("paper", 15)),
    Bind<&Settings::imagination_starts>(
        IntParameter(
            "imagination_starts", 64, 0, 1000000, "states",
            "Posterior states of the batch that dreams start from; 0 for all. [ours; paper: "
            "all]")
            .Preset("paper", 0)),
    Bind<&Settings::start_skip>(
        IntParameter(
            "start_skip", 4, 0, 1000, "decisions",
            "First steps of a sequence that no dream starts from, while the latent forgets its "
            "zero start; at most length - 1. [ours; paper: 0]")
            .Preset("paper", 0)),
    Bind<&Settings::discount>(
        RealParameter("discount", 0.99, 0, 1, "", "gamma, for one decision. [paper]")),
    Bind<&Settings::lambda>(
        RealParameter("lambda", 0.95, 0, 1, "", "The mix of the lambda-return. [paper]")),
    Bind<&Settings::actor_mean_limit>(
        RealParameter("actor_mean_limit", 5, 0.1, 100, "",
                      "The actor's mean is limit * tanh(m / limit). [dreamer]")),
    Bind<&Settings::actor_initial_std>(
        RealParameter("actor_initial_std", 1, 0.01, 20, "",
                      "Standard deviation of the fresh actor before tanh. [ours; dreamer: 5]")
            .Preset("paper", 5)),
    Bind<&Settings::actor_min_std>(
        RealParameter("actor_min_std", 0.1, 0, 1, "",
                      "Least standard deviation of the actor before tanh. [v3: 0.1; dreamer: 1e-4]")
            .Preset("paper", 1e-4)),
    Bind<&Settings::entropy_scale>(
        RealParameter(
            "entropy_scale", 3e-3, 0, 10, "",
            "Bonus on the actor's entropy, in units of the return scale. [ours; v3: 3e-4; v2 on "
            "states: 1e-4; paper: 0]")
            .Preset("paper", 0)),
    Bind<&Settings::percentile_return_scale>(
        ChoiceParameter(
            "return_scale", "percentile", "none,percentile",
            "What the actor's returns are divided by: 1, or a moving average of their 5 to "
            "95 percent range where that is above 1. [v3]")
            .Preset("paper", "none")),
    Bind<&Settings::return_scale_rate>(
        RealParameter("return_scale_rate", 0.01, 1e-4, 1, "",
                      "Rate of return_scale's moving average, per update. [v3]")),
    Bind<&Settings::value_scale>(
        RealParameter(
            "value_scale", 100, 0.01, 1e4, "",
            "The value is this times the network's output, which is fitted in its own units. "
            "[ours: 1 / (1 - gamma); paper: 1]")
            .Preset("paper", 1)),
    Bind<&Settings::least_of_critics>(
        ChoiceParameter("value_in_dreams", "mean", "mean,least",
                        "The ensemble's value that the returns of a dream are made of: its mean, "
                        "or its least. [MRS.Q: least]")),
    Bind<&Settings::slow_critic_weight>(
        RealParameter(
            "slow_critic_weight", 1, 0, 100, "",
            "Factor of the value's squared distance from its slow copy. [v3; paper: none]")
            .Preset("paper", 0)),
    Bind<&Settings::slow_critic_rate>(
        RealParameter("slow_critic_rate", 0.02, 0, 1, "",
                      "How far the slow copy follows the value at each update. [v3]")),
    kSearchPolicyWeightParameter,
    Bind<&Settings::search_value_weight>(RealParameter(
        "search_value_weight", 0.25, 0, 1, "",
        "Share of a search's value in the critic's target of the state searched. [ours]")),

    Bind<&Settings::model_learning_rate>(RealParameter(
        "model_learning_rate", 6e-4, 0, 1, "", "Adam's rate of the world model. [paper: 6e-4]")),
    Bind<&Settings::actor_learning_rate>(
        RealParameter("actor_learning_rate", 3e-4, 0, 1, "",
                      "Adam's rate of the actor. [TD-MPC2: 3e-4; paper: 8e-5]")
            .Preset("paper", 8e-5)),
    Bind<&Settings::value_learning_rate>(
        RealParameter("value_learning_rate", 3e-4, 0, 1, "",
                      "Adam's rate of the value. [TD-MPC2: 3e-4; paper: 8e-5]")
            .Preset("paper", 8e-5)),
    Bind<&Settings::adam_beta1>(
        RealParameter("adam_beta1", 0.9, 0, 0.9999, "", "Decay of Adam's first moment. [dreamer]")),
    Bind<&Settings::adam_beta2>(RealParameter("adam_beta2", 0.999, 0, 0.999999, "",
                                              "Decay of Adam's second moment. [dreamer]")),
    Bind<&Settings::adam_epsilon>(
        RealParameter("adam_epsilon", 1e-7, 1e-20, 1, "", "Adam's epsilon. [dreamer]")),
    Bind<&Settings::gradient_clip>(
        RealParameter("gradient_clip", 100, 1e-6, 1e9, "",
                      "Largest norm of a group's gradient; longer ones are shortened. [dreamer]")),

    Bind<&Settings::bfloat16>(PrecisionParameter("bfloat16").Preset("paper", "float")),
    Bind<&Settings::bfloat16_planning>(ChoiceParameter(
        "planning_precision", "float", "float,bfloat16",
        "Factors of the matrix products of what planners ask: transitions, rewards, values, "
        "proposals. bfloat16 is faster, but its error of half a percent can be larger than the "
        "differences that a search decides by. The posterior is always in float. "
        "[ours]")),
    Bind<&Settings::acting_latent_mean>(
        ChoiceParameter("acting_latent", "sample", "sample,mean",
                        "What Observe returns of the posterior. [dreamer: sample]")),
    Bind<&Settings::imagined_latent_mean>(ChoiceParameter(
        "imagined_latent", "mean", "sample,mean",
        "What Imagine returns of the prior to a planner. [ours: mean, so that equal "
        "actions give equal returns; training always samples]")),
    Bind<&Settings::actor_average>(RealParameter(
        "actor_average", 1, 1e-5, 1, "",
        "Rate at which the actor whose mode is played follows the one that learns and is sampled, "
        "at each update; 1: they are the same; 0.005 remembers some 200 updates. [Polyak and "
        "Juditsky 1992; of a policy: Nikishin et al. 2018]")));

}  // namespace

Settings SettingsFrom(const Parameters& parameters, bool terminates) {
  Settings settings = kSettings.Read(parameters);
  settings.continuation = settings.continuation && terminates;
  return settings;
}

View<const ParameterSpec> DeclaredParameters() { return kSettings.declared(); }

Settings PresetSettings(const char* preset) {
  const std::vector<ParameterValue> values = ValuesUnder(DeclaredParameters(), preset);
  return SettingsFrom({{values.data(), values.size()}}, false);
}

}  // namespace dreamsearch::dreamer
