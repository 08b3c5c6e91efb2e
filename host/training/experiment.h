// experiment.h - one run: interact, sample, fit, dream, until the budget is spent.
//
// The schedule is that of Koul et al. 2020 and Dreamer (Hafner et al. 2020):
// episodes that begin before run.prefill_steps are uniformly random; then
// run.pretrain_updates; then, at the end of each episode, run.updates for every
// run.train_every environment steps gained; with run.train_within_episode (TD-MPC2, Hansen
// et al. 2024) as soon as they are gained, from the episodes before. Evaluations come at step 0, at
// the first episode end after every run.eval_every environment steps, and at the end.
//
// Units    an *environment step* is one control step of the simulator, before
//          action repeat; a *decision* is one chosen action, random ones included.
// Stopping Run returns kInterrupted within one decision or update of a request;
//          Save then holds everything, mid-episode too, and a new Experiment that
//          loads it goes on with the very bits.
// Errors   Failure: 72 when something is not finite, 70 for other faults.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/acting/activity_clock.h"
#include "host/acting/agent.h"
#include "host/acting/components.h"
#include "host/acting/decision_tree.h"
#include "host/acting/episode.h"
#include "host/acting/episode_groups.h"
#include "host/saving/checkpoint.h"
#include "host/settings/retry.h"
#include "host/settings/settings.h"
#include "host/training/reanalysis.h"
#include "host/training/replay.h"
#include "host/training/run_loop.h"
#include "results/database/run_writer.h"

namespace dreamsearch {

class Experiment final : public RunLoop {
 public:
  struct Options {
    // How many threads the model may use, looked at before every update and evaluation;
    // null: one.
    const std::atomic<std::uint32_t>* threads = nullptr;
    bool log_decisions = false;
    bool record_trees = false;                      // keep the training decisions' search trees
    bool keep_replay = false;                       // a checkpoint before the budget's last action
    std::vector<Retry> retries;                     // of the run
    double segment_started = ActivityClock::Now();  // from when time is accounted
    double gflop_per_second = 0;                    // of this machine: what processor time is worth
    CheckpointHeader header;                        // of every checkpoint, read by whoever resumes
  };
  // `writer` receives the rows; it must have an open segment.
  Experiment(const RunSpec& spec, const Options& options, results::RunWriter* writer,
             std::filesystem::path folder);
  ~Experiment() override;

  Outcome Run(const std::atomic<bool>* stop, const Watcher& watcher) override;

  // The state, `with_replay` unless it is the last checkpoint of a finished run.
  void Save(CheckpointWriter* checkpoint, bool with_replay) const;
  void Load(const Checkpoint& checkpoint) override;

  std::uint64_t env_step() const override { return at_.env_step; }
  const ActivityClock::Use& TimeUse() { return clock_.Totals(); }

  // The trees of a training episode: of each decision whose planner reported one, TreeJson
  // with `env_step`. They are kept in a file in the run's folder, laid out as a checkpoint.
  using Trees = std::map<std::uint64_t, std::string>;
  static std::filesystem::path TreesPath(const std::filesystem::path& folder,
                                         std::uint64_t episode);
  static Trees ReadTrees(const std::filesystem::path& path);

  // What a resume needs to know of a checkpoint without making the components.
  static results::ResumePoint ResumePointOf(const Checkpoint& checkpoint);
  // Whether it was made in the middle of a training episode.
  static bool IsWithinEpisode(const Checkpoint& checkpoint);
  // Whether it holds the replay; the last one of a finished run does not.
  static bool HasReplay(const Checkpoint& checkpoint);
  // That replay. Searches are left out.
  static std::unique_ptr<Replay> ReadReplay(const Checkpoint& checkpoint, const RunSpec& spec);

 private:
  enum class Stage : std::uint32_t { kEpisodeStart, kEpisode, kLearn, kEvaluate, kDone };

  // The counters that decide what comes next.
  struct Position {
    std::uint64_t env_step = 0;
    std::uint64_t decisions = 0;
    std::uint64_t training_episodes = 0;  // finished ones
    std::uint64_t terminal_states = 0;    // that ended one of them
    std::uint64_t diverged_episodes = 0;  // that the environment ended by a divergence
    std::uint64_t diverged_in_a_row = 0;  // the latest ones
    std::uint64_t evaluations = 0;        // finished ones
    std::uint64_t evaluation_episodes = 0;
    std::uint64_t events = 0;          // events recorded by the checkpoint
    std::uint64_t evaluated_mark = 0;  // env_step / eval_every at the last one
    std::uint64_t updates = 0;
    std::uint64_t pending_updates = 0;
    std::uint64_t learned_env_step = 0;  // env_step up to which updates were granted
    std::uint64_t checkpoint_env_step = 0;
    std::uint64_t pretrained = 0;
    std::uint64_t burst_updates = 0;  // updates summed in burst_metrics_
    double last_training_return = std::numeric_limits<double>::quiet_NaN();
    double last_evaluation_return = std::numeric_limits<double>::quiet_NaN();
    Stage stage = Stage::kEvaluate;

    template <typename Archive>
    void Fields(Archive* archive) {
      (*archive)("env_step", &env_step);
      (*archive)("decisions", &decisions);
      (*archive)("training_episodes", &training_episodes);
      (*archive)("terminal_states", &terminal_states);
      (*archive)("diverged_episodes", &diverged_episodes);
      (*archive)("diverged_in_a_row", &diverged_in_a_row);
      (*archive)("evaluations", &evaluations);
      (*archive)("evaluation_episodes", &evaluation_episodes);
      (*archive)("events", &events);
      (*archive)("evaluated_mark", &evaluated_mark);
      (*archive)("updates", &updates);
      (*archive)("pending_updates", &pending_updates);
      (*archive)("learned_env_step", &learned_env_step);
      (*archive)("checkpoint_env_step", &checkpoint_env_step);
      (*archive)("pretrained", &pretrained);
      (*archive)("burst_updates", &burst_updates);
      (*archive)("last_training_return", &last_training_return);
      (*archive)("last_evaluation_return", &last_evaluation_return);
      (*archive)("stage", &stage);
    }
  };

  // The episode under way.
  struct EpisodeState {
    std::uint64_t t = 0;       // decisions made
    std::uint64_t length = 0;  // environment steps made
    std::uint64_t random = 0;  // whole episode of random actions
    double episode_return = 0;
    double wall_seconds = 0;
    std::uint64_t transitions_before = 0;
    std::uint64_t digest = 0;

    template <typename Archive>
    void Fields(Archive* archive) {
      (*archive)("t", &t);
      (*archive)("length", &length);
      (*archive)("random", &random);
      (*archive)("episode_return", &episode_return);
      (*archive)("wall_seconds", &wall_seconds);
      (*archive)("transitions_before", &transitions_before);
      (*archive)("digest", &digest);
    }
  };

  void BeginEpisode();
  void MakeDecision();
  void WarnOfTerminalState();
  // Ends the training episode because of what the environment reported; Failure 72 once too
  // many in a row ended so.
  void EndDivergedEpisode(const std::string& message);
  void DumpEpisode(const std::string& message);
  void FinishEpisode();
  // Grants the updates for the environment steps made since the last were granted.
  void EarnUpdates();
  void AdjustThreads();
  void MakeUpdate();
  void FinishUpdates();
  // False if a stop was asked for: then nothing was recorded.
  bool Evaluate();
  // Adds the rows of an evaluation's episodes; false if a stop was asked for.
  bool EvaluateWith(EpisodePlayers::Who who, results::Phase phase,
                    std::vector<results::EpisodeRow>* rows);
  void KeepTree(const Decision& decision);
  void MaybeCheckpoint();
  void RecordTimeUse();
  void WriteCheckpoint(bool with_replay);
  // A stop was asked for, or rows can no longer be stored.
  bool Stopping() const;
  void Watch(RunStage stage);
  void AddArtifact(const WrittenFile& file, const std::string& kind);
  void SaveEpisode(StateWriter* part) const;
  void SaveTrees(CheckpointWriter* file) const;
  void CheckPosition(const StateReader& part) const;
  void LoadEpisode(StateReader* part);
  void DumpDivergence(const std::string& message);
  // What stands for the run's seed in the training episode, see SeedWithRetries.
  std::uint64_t SeedAt(std::optional<std::uint64_t> env_step) const;
  std::uint32_t EnvironmentSeed() const;  // of the training episode

  const RunSpec spec_;
  const Options options_;
  results::RunWriter* writer_;
  const std::filesystem::path folder_;
  const std::uint64_t target_;

  Components components_;
  EnvironmentPtr environment_;
  EnvironmentPtr model_environment_;
  ModelPtr model_;
  std::uint32_t threads_ = 1;  // that the model was told of
  PlannerPtr planner_;
  std::unique_ptr<Agent> agent_;
  EpisodeGroups groups_;  // play the evaluations
  Replay replay_;
  std::unique_ptr<Reanalysis> reanalysis_;  // null without run.reanalyse
  const std::uint64_t eval_every_;          // environment steps

  ActivityClock clock_;
  Position at_;
  EpisodeState episode_;
  std::vector<double> observation_;      // what the next decision sees
  std::vector<double> action_;           // the last action
  std::vector<double> episode_actions_;  // of this episode, for environments without SaveState
  std::vector<double> plan_us_;          // of this episode
  std::vector<double> episode_metrics_;  // sums over this episode's planned decisions
  std::vector<double> burst_metrics_;    // sums over the updates since the last record
  std::vector<double> metrics_;
  TreeCollector tree_;
  Trees trees_;  // of this episode

  std::vector<std::int64_t> planner_metric_ids_;
  std::vector<std::int64_t> model_metric_ids_;

  const std::atomic<bool>* stop_ = nullptr;
  Watcher watcher_;
};

}  // namespace dreamsearch
