// The evaluations of a training: with the run's way of acting, and with the actor alone.
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/training/experiment.h"

namespace dreamsearch {

bool Experiment::EvaluateWith(EpisodePlayers::Who who, results::Phase phase,
                              std::vector<results::EpisodeRow>* rows) {
  const std::uint64_t episodes = spec_.run.Integer("eval_episodes");
  const std::size_t before = rows->size();
  rows->resize(before + episodes);
  std::uint64_t taken = 0, ended = 0;
  EpisodeFaults faults;
  EpisodeCourse course;
  course.next = [&]() -> std::optional<std::uint64_t> {
    if (taken == episodes || !faults.empty()) return std::nullopt;
    return taken++;
  };
  course.go_on = [&](std::uint64_t index, std::uint64_t) {
    if (Stopping() || !faults.MayGoOn(index)) return false;
    Watch(RunStage::kEvaluating);
    writer_->CommitIfDue();
    return true;
  };
  course.ended = [&](std::uint64_t index, const results::EpisodeRow& row) {
    ++ended;
    results::EpisodeRow& kept = (*rows)[before + index];
    kept = row;
    kept.phase = phase;
    kept.episode = Signed(at_.evaluations * episodes + index);
    kept.env_step = Signed(at_.env_step);
  };
  std::map<std::uint64_t, std::string> diverged;
  course.diverged = [&](std::uint64_t index, std::uint64_t t, const std::string& message) {
    diverged[index] = message + "; evaluation episode " +
                      std::to_string(at_.evaluations * episodes + index) + " ended after " +
                      std::to_string(t) + " decisions and has the return so far";
  };
  course.failed = [&](std::uint64_t index, std::exception_ptr error) {
    faults.Add(index, std::move(error));
  };
  groups_.Play(who, course, at_.env_step, threads_);
  if (ended < faults.FirstOr(episodes) && Stopping()) return false;
  faults.RethrowFirst();
  for (const auto& [index, message] : diverged) {
    writer_->AddEvent(Signed(at_.env_step), "warning", "divergence", message);
  }
  return true;
}

bool Experiment::Evaluate() {
  const auto episodes = spec_.run.Integer("eval_episodes");
  std::vector<results::EpisodeRow> rows;
  double mean_return = 0;
  {
    const ActivityScope scope(&clock_, Activity::kEvaluation);
    using Who = EpisodePlayers::Who;
    const bool searches = !spec_.eval_planner.Has(kActorAlone);
    if (searches &&
        !EvaluateWith(Who::kEvaluationPlanner, results::Phase::kSearchEvaluation, &rows)) {
      return false;
    }
    // Where the planner is the actor alone, its name and its metrics are what is met.
    if (!EvaluateWith(searches ? Who::kActor : Who::kEvaluationPlanner,
                      results::Phase::kActorEvaluation, &rows)) {
      return false;
    }
    // The run's own way of acting, which comes first, is what the progress line shows.
    for (std::uint64_t i = 0; i < episodes; ++i) mean_return += rows[i].episode_return;
    mean_return /= static_cast<double>(episodes);
  }
  {
    const ActivityScope scope(&clock_, Activity::kRecording);
    for (const results::EpisodeRow& row : rows) writer_->AddEpisode(row);
  }
  ++at_.evaluations;
  at_.evaluation_episodes += episodes;
  at_.evaluated_mark = at_.env_step / eval_every_;
  if (episodes > 0) at_.last_evaluation_return = mean_return;
  RecordTimeUse();
  return true;
}

}  // namespace dreamsearch
