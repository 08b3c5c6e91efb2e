// procedure.h - what a worker does for a run: it trains (Experiment) or evaluates
// (Evaluation).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "host/saving/checkpoint.h"

namespace dreamsearch {

// What a person watching wants to know.
struct RunProgress {
  const char* stage = "starting";
  std::uint64_t env_step = 0;    // of RunSpec::work_steps
  double training_return = 0;    // of the last episode; NaN before it
  double evaluation_return = 0;  // mean of the last evaluation; NaN before it
  std::uint64_t decisions = 1;   // made side by side until the next call
  std::uint32_t threads = 1;     // that the model may use
};

class Procedure {
 public:
  // Called often, at least once a decision and once an update.
  using Watcher = std::function<void(const RunProgress&)>;
  enum class Outcome { kFinished, kInterrupted };

  virtual ~Procedure() = default;

  // Goes on from what a checkpoint of it holds; comes before Run.
  virtual void Load(const Checkpoint& checkpoint) = 0;
  // Runs to the end, or until *stop is set: then a checkpoint holds everything.
  virtual Outcome Run(const std::atomic<bool>* stop, const Watcher& watcher) = 0;
  // Environment steps of training made, or those that an evaluation evaluates.
  virtual std::uint64_t env_step() const = 0;
};

}  // namespace dreamsearch
