// run_loop.h - the loop of a run: it trains (Experiment) or evaluates (Evaluation).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "host/saving/checkpoint.h"
#include "host/settings/run_spec.h"
#include "results/database/run_writer.h"

namespace dreamsearch {

enum class RunStage : std::uint32_t {
  kStarting = 0,
  kExploring = 1,  // at random
  kInteracting = 2,
  kLearning = 3,
  kEvaluating = 4,
  kFinished = 5,
};
// "learning": for people.
const char* RunStageName(RunStage stage);

// What a person watching wants to know. The worker reports it to the supervisor, which
// shows it.
struct RunProgress {
  RunStage stage = RunStage::kStarting;
  std::uint64_t env_step = 0;  // of RunSpec::work_steps
  // Of the last episode, and the mean of the last evaluation; NaN before it.
  double training_return = std::numeric_limits<double>::quiet_NaN();
  double evaluation_return = std::numeric_limits<double>::quiet_NaN();
  std::uint64_t decisions = 1;  // made side by side until the next call
  std::uint32_t threads = 1;    // that the model may use
  // That the run has waited so far for another process to unlock the database; 0: it works.
  double lock_wait_seconds = 0;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("stage", &stage);
    (*archive)("env_step", &env_step);
    (*archive)("training_return", &training_return);
    (*archive)("evaluation_return", &evaluation_return);
    (*archive)("decisions", &decisions);
    (*archive)("threads", &threads);
    (*archive)("lock_wait_seconds", &lock_wait_seconds);
  }
};

// The database counts in signed 64-bit integers.
inline std::int64_t Signed(std::uint64_t count) { return static_cast<std::int64_t>(count); }

// The ids of the component's metrics, "mcts_pw.root_visit_entropy", in their order.
std::vector<std::int64_t> MetricIds(const ResolvedComponent& component, results::RunWriter* writer);

class RunLoop {
 public:
  // Called often, at least once a decision and once an update.
  using Watcher = std::function<void(const RunProgress&)>;
  enum class Outcome { kFinished, kInterrupted };

  virtual ~RunLoop() = default;

  // Goes on from what a checkpoint of it holds; comes before Run.
  virtual void Load(const Checkpoint& checkpoint) = 0;
  // Runs to the end, or until *stop is set: then a checkpoint holds everything.
  virtual Outcome Run(const std::atomic<bool>* stop, const Watcher& watcher) = 0;
  // Environment steps of training made, or those that an evaluation evaluates.
  virtual std::uint64_t env_step() const = 0;
};

}  // namespace dreamsearch
