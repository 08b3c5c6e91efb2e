#include "plugins/model_tdmpc/settings.h"

#include <vector>

namespace dreamsearch::tdmpc {
namespace {

// Sources: [paper] TD-MPC2, Hansen et al. 2024, and its code; [SimbaV2] Lee et al. 2025;
// [ours] chosen here, see README.md.
constexpr auto kSettings = BindSettings<Settings>(
    Bind<&Settings::simplices>(
        IntParameter("simplices", 16, 1, 512, "",
                     "Softmaxes in the latent, of 8 numbers each. [ours; paper: 64]")
            .Preset("paper", 64)),
    Bind<&Settings::encoder_width>(
        IntParameter("encoder_width", 128, 1, 4096, "units",
                     "Width of the encoder's hidden layers. [ours; paper: 256]")
            .Preset("paper", 256)),
    Bind<&Settings::encoder_layers>(IntParameter(
        "encoder_layers", 1, 1, 8, "layers",
        "Hidden layers of the encoder, before the layer that gives the latent. [paper]")),
    Bind<&Settings::width>(
        IntParameter(
            "width", 128, 1, 4096, "units",
            "Width of the hidden layers of dynamics, reward, critics and actor. [ours; paper: "
            "512]")
            .Preset("paper", 512)),
    Bind<&Settings::layers>(
        IntParameter("layers", 2, 1, 8, "layers",
                     "Hidden layers of dynamics, reward, critics and actor. [paper]")),
    Bind<&Settings::critics>(
        IntParameter("critics", 2, 1, 16, "",
                     "Q functions in the ensemble, all trained. [ours; paper: 5]")
            .Preset("paper", 5)),
    Bind<&Settings::bin_count>(
        IntParameter("bins", 101, 2, 1001, "",
                     "Bins of the distributions that give rewards and values. [paper]")),
    Bind<&Settings::bin_range>(RealParameter(
        "bin_range", 10, 0.1, 100, "",
        "The bins lie evenly in symlog space from minus to plus this; targets are clipped "
        "to the range. [paper]")),

    Bind<&Settings::normalise_observations>(
        BoolParameter("normalise_observations", true,
                      "Encode observations standardised by the running mean and variance of the "
                      "training batches. [SimbaV2]")
            .Preset("paper", false)),
    kObservationFloorParameter, kObservationClipParameter,
    Bind<&Settings::rho>(RealParameter(
        "rho", 0.5, 0, 1, "",
        "Weight of a step's losses relative to those of the step before it. [paper]")),
    Bind<&Settings::consistency_weight>(
        RealParameter("consistency_weight", 20, 0, 1e4, "",
                      "Factor of the squared distance of imagined from encoded latents. [paper]")),
    Bind<&Settings::reward_weight>(
        RealParameter("reward_weight", 0.1, 0, 1e4, "", "Factor of the reward loss. [paper]")),
    Bind<&Settings::value_weight>(
        RealParameter("value_weight", 0.1, 0, 1e4, "", "Factor of the critics' loss. [paper]")),
    Bind<&Settings::continuation_weight>(RealParameter(
        "continuation_weight", 1, 0, 1e4, "",
        "Factor of the continuation loss, from the first batch on in which an episode "
        "ends early. [paper]")),
    Bind<&Settings::discount>(RealParameter(
        "discount", 0.99, 0, 1, "",
        "Discount gamma of one decision. [paper: 0.99 for episodes of 500 decisions]")),
    Bind<&Settings::lambda>(
        RealParameter("lambda", 0, 0, 1, "",
                      "Share of the next step's target in the value that a critic's target goes on "
                      "with: 0 trusts the critics after one step [paper], 1 at the end of the "
                      "training's sequence [MR.Q, Fujimoto et al. 2025: 3 steps].")),
    Bind<&Settings::target_of_all>(
        ChoiceParameter("target", "two", "two,all",
                        "The critics whose least value is the target: two drawn for each update "
                        "[paper], or all of them.")),
    Bind<&Settings::target_rate>(
        RealParameter("target_rate", 0.01, 0, 1, "",
                      "How far the target critics follow the critics at each update. [paper]")),
    Bind<&Settings::min_log_std>(
        RealParameter("min_log_std", -10, -20, 0, "",
                      "Least logarithm of the actor's deviation before tanh. [paper]")),
    Bind<&Settings::max_log_std>(
        RealParameter("max_log_std", 2, 0.01, 5, "", "Largest logarithm of it. [paper]")),
    Bind<&Settings::entropy_scale>(
        RealParameter("entropy_scale", 1e-4, 0, 10, "",
                      "Bonus on the actor's entropy, for each action component, in units of the "
                      "return scale. [paper]")),
    Bind<&Settings::return_scale_rate>(
        RealParameter("return_scale_rate", 0.01, 1e-4, 1, "",
                      "Rate of the moving average of the values' 5 to 95 percent range, which the "
                      "actor's values are divided by. [paper]")),
    kSearchPolicyWeightParameter,
    Bind<&Settings::search_value_weight>(RealParameter(
        "search_value_weight", 0, 0, 1, "",
        "Share of a search's value in the critic's target of the state searched. [ours]")),

    Bind<&Settings::learning_rate>(
        RealParameter("learning_rate", 3e-4, 0, 1, "",
                      "Adam's rate of dynamics, reward, continuation and critics. [paper]")),
    Bind<&Settings::encoder_rate_factor>(
        RealParameter("encoder_rate_factor", 0.3, 0, 10, "",
                      "The encoder's rate, as a factor of learning_rate. [paper]")),
    Bind<&Settings::actor_learning_rate>(
        RealParameter("actor_learning_rate", 3e-4, 0, 1, "", "Adam's rate of the actor. [paper]")),
    Bind<&Settings::adam_epsilon>(
        RealParameter("adam_epsilon", 1e-8, 1e-20, 1, "", "Adam's epsilon. [paper]")),
    Bind<&Settings::actor_adam_epsilon>(
        RealParameter("actor_adam_epsilon", 1e-5, 1e-20, 1, "", "The same for the actor. [paper]")),
    Bind<&Settings::gradient_clip>(
        RealParameter("gradient_clip", 20, 1e-6, 1e9, "",
                      "Largest norm of the actor's gradient, and of that of all others together. "
                      "[paper]")),
    Bind<&Settings::bfloat16>(PrecisionParameter("float")),
    Bind<&Settings::bfloat16_planning>(ChoiceParameter(
        "planning_precision", "float", "float,bfloat16",
        "Factors of the matrix products of what planners ask: transitions, rewards, values, "
        "proposals. [ours]")));

}  // namespace

Settings SettingsFrom(const Parameters& parameters) {
  Settings settings = kSettings.Read(parameters);
  settings.latent = kSimplex * settings.simplices;
  settings.bins = {settings.bin_count, -settings.bin_range, settings.bin_range};
  return settings;
}

View<const ParameterSpec> DeclaredParameters() { return kSettings.declared(); }

Settings PresetSettings(const char* preset) {
  const std::vector<ParameterValue> values = ValuesUnder(DeclaredParameters(), preset);
  return SettingsFrom({{values.data(), values.size()}});
}

}  // namespace dreamsearch::tdmpc
