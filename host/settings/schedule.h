// schedule.h - how often a run decides, learns and evaluates.
//
// The experiment loop and the estimates of a dry run share these figures.
#pragma once

#include <algorithm>
#include <cstdint>

#include "host/settings/settings.h"

namespace dreamsearch {

class Schedule {
 public:
  // episode_steps: environment steps of an episode of the task.
  Schedule(const RunSpec& spec, std::uint64_t episode_steps)
      : spec_(spec), steps_(spec.steps()), episode_steps_(episode_steps) {}

  // Environment steps between evaluations.
  std::uint64_t eval_every() const {
    const std::uint64_t declared = spec_.run.Integer("eval_every");
    if (declared != 0) return declared;
    return std::max<std::uint64_t>(1, std::min<std::uint64_t>(10000, steps_ / 10));
  }
  std::uint64_t decisions_per_episode() const {
    return CeilDivide(std::min(episode_steps_, steps_), spec_.action_repeat());
  }
  std::uint64_t training_episodes() const { return CeilDivide(steps_, episode_steps_); }
  std::uint64_t decisions() const {
    return steps_ / episode_steps_ * decisions_per_episode() +
           CeilDivide(steps_ % episode_steps_, spec_.action_repeat());
  }
  // Rows of the replay if no episode ends before its time limit: a decision and an episode's
  // first observation are one each.
  std::uint64_t replay_rows() const {
    const std::uint64_t declared = spec_.run.Integer("replay_capacity");
    if (declared != 0) return declared;
    return training_episodes() * (decisions_per_episode() + 1);
  }
  // The most rows that the replay may hold: without a declared number all of the budget, also
  // if each episode has a single decision.
  std::uint64_t replay_capacity() const {
    const std::uint64_t declared = spec_.run.Integer("replay_capacity");
    return declared != 0 ? declared : 2 * CeilDivide(steps_, spec_.action_repeat()) + 2;
  }
  // Environment steps of the episodes that begin before run.prefill_steps.
  std::uint64_t random_steps() const {
    return std::min(
        steps_, CeilDivide(spec_.run.Integer("prefill_steps"), episode_steps_) * episode_steps_);
  }
  std::uint64_t planned_decisions() const {
    return (steps_ - random_steps()) / spec_.action_repeat();
  }
  std::uint64_t updates() const {
    return spec_.run.Integer("pretrain_updates") + (steps_ - random_steps()) /
                                                       spec_.run.Integer("train_every") *
                                                       spec_.run.Integer("updates");
  }
  // Evaluations happen at step 0, at episode ends, and at the end.
  std::uint64_t evaluations() const {
    return 1 + CeilDivide(steps_, std::max(eval_every(), episode_steps_));
  }

 private:
  static std::uint64_t CeilDivide(std::uint64_t a, std::uint64_t b) { return (a + b - 1) / b; }

  const RunSpec& spec_;
  std::uint64_t steps_;
  std::uint64_t episode_steps_;
};

}  // namespace dreamsearch
