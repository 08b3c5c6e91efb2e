// run_parameters.h - the host's own settings, `run.*`.
//
// Declared like a plugin's, so that ranges, presets, help and the stored
// configuration work the same way. The help names sources: [paper] Koul et al. 2020,
// "Dream and Search to Control", whose schedule is Dreamer's, changed; [dreamer]
// Hafner et al. 2020.
#pragma once

#include <string_view>

#include "dreamsearch/parameter.h"
#include "dreamsearch/view.h"

namespace dreamsearch {

// In units of "steps", an environment step is a control step of the simulator,
// before action repeat.
inline constexpr ParameterSpec kRunParameters[] = {
    IntParameter("steps", 100000, 1, 1000000000000, "steps",
                 "Budget of a run in environment steps; --steps sets it.")
        .Preset("fast", 100000)
        .Preset("paper", 2000000),
    IntParameter("action_repeat", 2, 1, 16, "steps",
                 "Environment steps for which a decision's action is held. [dreamer, paper: 2]")
        .Preset("fast", 2)
        .Preset("paper", 2),
    IntParameter("prefill_steps", 5000, 0, 1000000000, "steps",
                 "Environment steps of uniformly random actions before the first training "
                 "episode; they count in the budget. [dreamer, paper: 5000]")
        .Preset("fast", 5000)
        .Preset("paper", 5000),
    IntParameter("exploration_hold", 8, 1, 10000, "decisions",
                 "For how many decisions, on average, the same random numbers choose the actions "
                 "of training: those of the prefill, and the samples and noise of the planner. "
                 "White noise does not swing a pole up; held noise leans one way for a while. "
                 "[ours; Eberhard et al. 2023 colour it; dreamer, paper: 1]")
        .Preset("fast", 8)
        .Preset("paper", 1),
    IntParameter("pretrain_updates", 100, 0, 1000000, "updates",
                 "Updates before the first training episode. [dreamer: 100]")
        .Preset("fast", 100)
        .Preset("paper", 100),
    IntParameter("train_every", 1, 1, 1000000, "steps",
                 "Environment steps for which updates are made: one, or run.updates. [ours, "
                 "results/published/tuning_fast.md; paper: 10]")
        .Preset("fast", 1)
        .Preset("paper", 10),
    IntParameter("updates", 1, 1, 1000, "updates",
                 "Updates for each run.train_every environment steps. [SimbaV2: 1 to 8 for a "
                 "decision; TD-MPC2, paper: 1]")
        .Preset("fast", 1)
        .Preset("paper", 1),
    BoolParameter(
        "train_within_episode", false,
        "Make each update as soon as its steps are made, between two decisions, and not at "
        "the episode's end. [TD-MPC2: true; dreamer, paper: false]")
        .Preset("fast", false)
        .Preset("paper", false),
    IntParameter("batch_size", 16, 1, 4096, "sequences",
                 "Sequences in a training batch. [DreamerV3: 16; paper: 50]")
        .Preset("fast", 16)
        .Preset("paper", 50),
    IntParameter("sequence_length", 32, 2, 1000, "decisions",
                 "Decisions in a training sequence. [ours; paper: 50]")
        .Preset("fast", 32)
        .Preset("paper", 50),
    BoolParameter("search_targets", false,
                  "Keep what each search of the training found, its improved policy and its value, "
                  "and train the model on it; needs a planner and a model that declare so. [BMPC, "
                  "Wang et al. 2025: true]")
        .Preset("fast", false)
        .Preset("paper", false),
    IntParameter("search_candidates", 8, 1, 1000, "actions",
                 "Actions of an improved policy that are kept, the heaviest ones. [ours]")
        .Preset("fast", 8)
        .Preset("paper", 8),
    RealParameter("reanalyse", 0, 0, 1, "",
                  "Share of an update's states whose search is made anew with the present model. "
                  "[BMPC: 0.008; 0: none]")
        .Preset("fast", 0)
        .Preset("paper", 0),
    IntParameter("diverged_episodes", 10, 1, 1000000, "episodes",
                 "Training episodes in a row that the simulator may end by a divergence before "
                 "the run is given up. [ours]")
        .Preset("fast", 10)
        .Preset("paper", 10),
    IntParameter("eval_episodes", 5, 1, 1000, "episodes",
                 "Episodes of an evaluation, with the same initial states every time. [ours]")
        .Preset("fast", 5)
        .Preset("paper", 5),
    IntParameter("eval_every", 0, 0, 1000000000, "steps",
                 "Environment steps between evaluations; 0: min(10000, steps / 10).")
        .Preset("fast", 0)
        .Preset("paper", 0),
    IntParameter("checkpoint_every", 5000, 1, 1000000000, "steps",
                 "Environment steps between checkpoints.")
        .Preset("fast", 5000)
        .Preset("paper", 5000),
    IntParameter(
        "replay_capacity", 0, 0, 1000000000, "decisions",
        "Decisions the replay keeps, the oldest episodes leave first; 0: the whole budget.")
        .Preset("fast", 0)
        .Preset("paper", 0),
};

// Those that came when there were databases already, with the value by which runs were made before:
// a run that was recorded without them has it, and it is not written in configurations, so that
// such a run keeps its own.
struct LaterRunParameter {
  std::string_view name;
  double before;
};
inline constexpr LaterRunParameter kLaterRunParameters[] = {
    {"exploration_hold", 1},
    {"updates", 1},
};

inline constexpr View<const ParameterSpec> RunParameters() noexcept {
  return {kRunParameters, sizeof kRunParameters / sizeof kRunParameters[0]};
}

}  // namespace dreamsearch
