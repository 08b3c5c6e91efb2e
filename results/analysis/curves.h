// curves.h - learning curves read from one or more databases.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "results/analysis/run_groups.h"
#include "results/database/database.h"

namespace dreamsearch::results {

// kCompute: core-minutes at 60 GFLOP/s, that is the processor seconds of a run times what a core
// computes a second, over 3,600; one axis for machines of different speed.
enum class CurveAxis { kSteps, kSeconds, kTransitions, kCompute };

struct CurveRequest {
  RunFilter filter;
  CurvePhase phase = CurvePhase::kEvaluation;
  CurveAxis axis = CurveAxis::kSteps;
  bool log_x = false;
  int smooth = 1;  // points of a centred moving mean; 1: none
  // Sources of `published` to draw beside: methods, as "method" or "method/obs".
  std::vector<std::string> published;
};

// One run. The points are evaluations at their own steps, or, in budgets of
// 200,000 steps and more, bins of 10,000 at their upper end.
struct RunCurve {
  std::int64_t seed = 0;
  std::string uuid;
  std::string unfinished;  // Unfinished(run)
  std::int64_t env_steps_done = 0;
  std::int64_t env_steps_target = 0;
  std::vector<double> x;  // of the axis asked for
  std::vector<std::int64_t> env_step;
  std::vector<double> value;            // mean return of the point's episodes
  std::vector<std::int64_t> nonfinite;  // steps at which no return was finite: no point
  std::vector<std::int64_t> evaluated;  // steps of all of these, thinned or not
};

// The runs of one line: one task and everything else in common but the seed.
struct Line {
  std::string task;
  std::string label;    // RunGroup::label
  std::string planner;  // empty for a published line
  std::size_t planner_rank = 0;
  bool published = false;
  // What chose the actions of its evaluations: " with search", " actor", or, where a planner that
  // is neither did (random), nothing.
  std::string acting;
  bool binned = false;        // points are bins rather than evaluations
  std::int64_t thinning = 1;  // one point stands for so many
  std::optional<double> return_low, return_high;
  std::vector<RunCurve> runs;  // by seed; runs without a point included
  // Sentences: seeds that it lacks (missing_runs.h), and records that gave way to others of
  // the same experiment (RunTwice).
  std::vector<std::string> missing, twice;

  // Runs that have at least one point.
  int n() const;
};

// The lines of GroupRuns, then the published ones of the same tasks.
std::vector<Line> ReadLines(const std::vector<std::unique_ptr<Database>>& databases,
                            const CurveRequest& request);

// Replaces neighbouring points of each of our runs by their mean, as few as leave at most
// about so many points of a run; the first point, of the untrained agent, stays by itself.
// Runs of a line whose steps differ stay whole: of the grid on which they are averaged
// (common_steps.h) only every so many steps stay, with their values as they were. Published
// curves stay whole. Returns how many points became one: equal on every axis.
std::size_t Thin(std::size_t most_points, std::vector<Line>* lines);

// "walker_walk, mcts_pw: seed 2 failed at 12,000 of 60,000 steps.", a sentence for the seeds of a
// line that stopped alike, and one for those that are missing.
std::vector<std::string> MissingOrUnfinished(const std::vector<Line>& lines);
// What there is to know of the runs of these lines: experiments that were done twice, then
// MissingOrUnfinished.
std::vector<std::string> NotesOfRuns(const std::vector<Line>& lines);

}  // namespace dreamsearch::results
