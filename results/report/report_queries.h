// report_queries.h - the SQL with which a reader gets the numbers of the report's figures from the
// database, all of them where the page thins them out.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "results/analysis/curves.h"

namespace dreamsearch::results {

class ReportQueries {
 public:
  // The lines are those of the page: a query names their runs as the page does.
  ReportQueries(const RunFilter& filter, const std::vector<Line>& lines);

  // As LineCurve: task, line, env_step, mean, lo, hi, seeds.
  std::string Curves() const;
  // As TaskMean: line, env_step, mean, lo, hi, seeds.
  std::string OverTasks() const;
  // As TimeTable: line, activity, seconds for 1,000 environment steps.
  std::string Time() const;
  // The scores of single runs on these tasks.
  std::string Scores(const std::vector<std::string>& tasks) const;
  std::string Runs() const;

 private:
  // The condition that the filter is, on these columns.
  std::string Chosen(const std::string& study, const std::string& task, const std::string& planner,
                     const std::string& seed) const;
  // The runs of the page with the phase that is drawn of each, as table r.
  std::string WithRuns() const;
  // And their points, as table p, and their values at common steps, as table c: of the runs
  // of one task, or of all tasks.
  std::string WithPoints(bool by_task) const;

  RunFilter filter_;
  std::string line_of_run_;  // SQL: a run's line
  std::size_t tasks_ = 0;
  bool binned_ = false;  // points are bins rather than evaluations
  // The spacing of the grid, for lines that are averaged on one (common_steps.h).
  using Place = std::pair<std::string, std::string>;  // task, line
  std::map<Place, std::int64_t> uneven_by_task_, uneven_over_tasks_;
};

}  // namespace dreamsearch::results
