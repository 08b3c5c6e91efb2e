#include "host/flags/run_flags.h"

#include <utility>

#include "host/flags/flags.h"
#include "results/command_line/values.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

constexpr char kEvalCommand[] = "runner eval";
constexpr char kEpisodesKey[] = "run.eval_episodes";

std::vector<Flag> Joined(std::vector<Flag> flags, std::vector<Flag> more) {
  flags.insert(flags.end(), std::make_move_iterator(more.begin()),
               std::make_move_iterator(more.end()));
  return flags;
}

FlagGroup EarlierRuns(std::vector<Flag> flags) { return {"Runs that exist", std::move(flags)}; }

[[noreturn]] void EvaluationUsage(const std::string& message) {
  throw Failure(ExitCode::kUsage, std::string(kEvalCommand) + ": " + message);
}

}  // namespace

CommandSpec RunFlags(RunOptions* options) {
  options->seeds = {0};
  ProcessOptions* process = &options->process;
  std::vector<Flag> what = Joined(
      {{"env", "NAMES", Names(&options->environments).Required(), "tasks, separated by commas"},
       {"planner", "NAMES", Names(&options->planners).Required(), "planners, separated by commas"},
       {"model", "NAMES", Names(&options->models).Default("the default model that learns"),
        "models, separated by commas"},
       {"eval-planner", "NAME", Text(&options->eval_planner).Default("the run's own"),
        "planner of the evaluation with search"}},
      SeedFlags(&options->seeds));
  what.push_back({"study", "NAME", StudyName(&options->study),
                  "the named comparison that the runs belong to"});
  return {
      .name = "runner",
      .summary = "trains agents that look ahead in learned latent spaces, and records them",
      .usage = {"runner --env NAMES --planner NAMES [flags]    train every combination",
                "runner COMMAND [arguments]                    see Commands"},
      .examples = {"runner --env walker_walk --planner mcts_pw --seeds 3",
                   "runner --env walker_walk,cartpole_swingup --planner dreamer,rollout,mcts_pw \\",
                   "       --seeds 3 --study first --set planner.noise_std=0.2 --dry-run",
                   "runner --config experiments/quickstart.cfg --steps 20000"},
      .about =
          "The same command again skips the runs that are finished and resumes those that "
          "are not. `runner list` shows the tasks, models and planners.\n"
          "With several runs the exit status is 75 if the command was stopped, otherwise that "
          "of the first run that did not succeed. A run that failed before and is skipped "
          "counts as well.",
      .groups =
          {{"What to run", std::move(what)},
           {"With which settings",
            {{"preset", "NAME", Text(&options->preset),
              "fast, sized for a CPU, or paper, with the paper's sizes and schedule"},
             {"steps", "N", SettingOf(&options->settings, "run.steps").Default("the preset's"),
              "environment steps of each run, before action repeat"},
             SetFlag(&options->settings),
             {"config", "FILE", FlagsFile(),
              "read flags from this file, one `name = value` a line; the command line wins. A "
              "value "
              "is the rest of the line up to a #, without quotes; a relative path in a setting "
              "begins in this file's folder"}}},
           WorkFlags(process),
           EarlierRuns({RetryFlag(process), ReplaceFlag(process)}),
           {"What to record", Joined(RecordingFlags(process), {DryRunFlag(process)})}},
      .exclusive = {{"seeds", "seed-list"}}};
}

CommandSpec EvaluationFlags(EvaluationOptions* evaluation) {
  RunOptions* options = &evaluation->choice;
  options->evaluate = true;
  options->preset.clear();
  options->study.clear();
  ProcessOptions* process = &options->process;
  std::vector<Flag> without_run =
      Joined({{"env", "NAMES", Names(&options->environments), "tasks, separated by commas"}},
             SeedFlags(&options->seeds));
  without_run.push_back({"study", "NAME", StudyName(&options->study).Default("default"),
                         "the named comparison that the evaluations belong to"});
  return {
      .name = kEvalCommand,
      .summary = "plays evaluation episodes of a trained agent, under any planner",
      .usage = {"runner eval RUN --planner NAMES [flags]            a trained run's newest "
                "checkpoint",
                "runner eval --env NAMES --planner NAMES [flags]    no training: on the oracle"},
      .examples = {"runner eval 3 --planner dreamer,rollout,mcts_pw --episodes 20",
                   "runner eval 3 --planner mcts_pw --model dreamer,oracle --episodes 20",
                   "runner eval --env cartpole_swingup,reacher_easy --planner random,cem,mppi "
                   "--episodes 20"},
      .about =
          "The model `oracle` is the simulator itself. With RUN it takes proposal and value from "
          "the trained actor and critic, so the second example separates the planner's error from "
          "the model's. Without RUN it proposes uniform random actions and gives everything the "
          "value 0; the planner `random` is then the baseline, and `dreamer` plays the action 0. A "
          "planner that the run trained or evaluated with keeps the run's settings, others have "
          "those of the preset; --set changes any. Of the task it "
          "changes factors of variation, such as env.gravity_scale, if the task has them: the "
          "agent then plays in a changed world, and the model `oracle` knows that world.\n"
          "Episode i starts in the same state under every planner and model of a run seed. The "
          "table on standard output shows the mean return and its standard error, milliseconds a "
          "decision and model transitions a decision. For times that no other episode disturbs, "
          "play one at a time with --jobs 1. With --rank-every it has, over the decisions whose "
          "root actions had different returns, the rank correlation of their Q with these returns, "
          "the share of the root's visits that the first action has, by how much the best action's "
          "return is above the played one's (regret), and the best one's above the worst one's "
          "(spread). "
          "Every evaluation is a run of the database that names "
          "its parent. The same command again plays only what is missing.",
      .arguments = {{"", "RUN", Text(&evaluation->run),
                     "the trained run: its number or the beginning of its UUID, from `runner "
                     "status`"}},
      .groups =
          {{"What to evaluate",
            {{"planner", "NAMES", Names(&options->planners).Required(),
              "planners, separated by commas"},
             {"model", "NAMES",
              Names(&options->models)
                  .Default("the run's own; without RUN the default model that does not learn"),
              "models, separated by commas"},
             {"episodes", "N", SettingOf(&options->settings, kEpisodesKey).Default(kEpisodesKey),
              "episodes of each planner and model"}}},
           {"How well a search ranks its actions",
            {{"rank-every", "N", Whole(&evaluation->ranks.every, 0),
              "at every N-th decision play each action that the search tried, with the actor from "
              "there on, in the simulator, and compare the returns with what the search promised; "
              "0: never"},
             {"rank-decisions", "N", Whole(&evaluation->ranks.decisions, 1),
              "decisions that such a return counts"}}},
           {"Without RUN", std::move(without_run)},
           {"With which settings",
            {{"preset", "NAME", Text(&options->preset).Default("the run's; fast without RUN"),
              "preset of planners and models that the run did not train with"},
             SetFlag(&options->settings),
             TrustModuleFlag(&process->trusted_modules)}},
           WorkFlags(process),
           EarlierRuns({RetryFlag(process), ReplaceFlag(process)})},
      .exclusive = {{"seeds", "seed-list"}}};
}

void CompleteEvaluation(EvaluationOptions* evaluation) {
  RunOptions& options = evaluation->choice;
  const bool trained = !evaluation->run.empty();
  for (const Setting& setting : options.settings) {
    if (!setting.key.starts_with("run.") || setting.key == kEpisodesKey) continue;
    if (!trained && setting.key == "run.action_repeat") continue;
    throw Failure(ExitCode::kUsage,
                  setting.where + ": " + setting.key +
                      (trained ? ": expected a parameter of a planner or a model, because the "
                                 "trained run keeps its settings"
                               : ": expected run.action_repeat or a parameter of env, model or a "
                                 "planner, because nothing is trained"));
  }
  if (trained) {
    const std::pair<bool, const char*> of_run[] = {{!options.environments.empty(), "--env"},
                                                   {!options.seeds.empty(), "--seeds"},
                                                   {!options.study.empty(), "--study"}};
    for (const auto& [given, flag] : of_run) {
      if (!given) continue;
      EvaluationUsage(std::string("expected RUN or ") + flag +
                      ", found both; the evaluation takes it from the trained run");
    }
    return;
  }
  if (options.environments.empty()) {
    EvaluationUsage(
        "expected a trained run or a task, RUN or --env NAMES, found neither. Example: runner "
        "eval --env cartpole_swingup --planner random,cem");
  }
  if (options.study.empty()) options.study = "default";
  if (options.seeds.empty()) options.seeds = {0};
  if (options.preset.empty()) options.preset = "fast";
}

}  // namespace dreamsearch
