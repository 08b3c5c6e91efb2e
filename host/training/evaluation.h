// evaluation.h - a run of `runner eval`: episodes of a trained agent, or of a model
// that needs no training, under one planner.
//
// Episode i has the seeds it has in every evaluation of the run seed, so a trained
// run's own planner plays here the very episodes of its last evaluation. Each thread has
// a model of its own and plays a group of episodes side by side (episode.h); they are
// recorded in their order, and neither threads nor groups change anything but the time.
// A planner that declares kActorAlone is recorded as the actor alone (results::Phase).
//
// A checkpoint follows every recorded episode; a resume goes on with the next.
// Errors   Failure, that of the first episode that has a fault: 72 when something is not
// finite; 65 if the trained run's
//          checkpoint is not the one that was to be evaluated, 66 if it is gone.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/acting/agent.h"
#include "host/acting/components.h"
#include "host/acting/episode.h"
#include "host/acting/joint_model.h"
#include "host/settings/settings.h"
#include "host/training/run_loop.h"
#include "results/database/run_writer.h"

namespace dreamsearch {

// A trained agent, ready to play evaluation episodes.
class EvaluationPlayer {
 public:
  // agent: the trained run's checkpoint; nothing if the evaluation names no trained run.
  // `model_threads` as for Model::SetThreads. `episodes`: as many are played side by side.
  EvaluationPlayer(const Components& components, const RunSpec& spec,
                   const std::optional<Checkpoint>& agent, std::uint32_t model_threads,
                   std::size_t episodes);

  void Play(const EpisodeCourse& course) { players_->Play(course, env_step_); }

 private:
  const std::uint64_t env_step_;
  std::vector<EnvironmentPtr> environments_;  // of each episode
  EnvironmentPtr model_environment_;
  ModelPtr trained_;
  ModelPtr model_;
  std::unique_ptr<JointModel> joint_;
  std::unique_ptr<EpisodePlayers> players_;
};

// The trained run's checkpoint, checked against what the evaluation names; nothing if
// it names no trained run.
std::optional<Checkpoint> OpenAgent(const RunSpec& spec, const std::filesystem::path& checkpoint);

class Evaluation final : public RunLoop {
 public:
  struct Options {
    std::uint32_t threads = 1;    // groups of episodes at once
    std::filesystem::path agent;  // the trained run's checkpoint; empty for none
    CheckpointHeader header;      // of every checkpoint, read by whoever resumes
  };

  // `writer` receives the rows; it must have an open segment.
  Evaluation(const RunSpec& spec, const Options& options, results::RunWriter* writer,
             std::filesystem::path folder);
  ~Evaluation() override;

  void Load(const Checkpoint& checkpoint) override;
  Outcome Run(const std::atomic<bool>* stop, const Watcher& watcher) override;
  std::uint64_t env_step() const override { return spec_.evaluation->env_step; }

  // What a resume needs to know of a checkpoint.
  static results::ResumePoint ResumePointOf(const Checkpoint& checkpoint, std::uint64_t env_step);

 private:
  struct Played;
  class EpisodeQueue;

  // What is recorded so far.
  struct Position {
    std::uint64_t episodes = 0;
    std::uint64_t decisions = 0;
    std::uint64_t env_steps = 0;  // played
    std::uint64_t events = 0;
    double return_sum = 0;
    double seconds = 0;               // of wall time, all segments
    std::vector<double> metric_sums;  // over all recorded decisions

    template <typename Archive>
    void Fields(Archive* archive) {
      (*archive)("episodes", &episodes);
      (*archive)("decisions", &decisions);
      (*archive)("env_steps", &env_steps);
      (*archive)("events", &events);
      (*archive)("return_sum", &return_sum);
      (*archive)("seconds", &seconds);
      (*archive)("metric_sums", &metric_sums);
    }
  };

  void Record(const Played& played, double seconds);

  const RunSpec spec_;
  const Options options_;
  results::RunWriter* writer_;
  const std::filesystem::path folder_;
  Components components_;
  // The planner's metrics, and what rankings give.
  std::vector<std::int64_t> metric_ids_;
  std::size_t planner_metrics_ = 0;
  Position at_;
};

}  // namespace dreamsearch
