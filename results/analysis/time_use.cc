#include "results/analysis/time_use.h"

#include "results/analysis/run_groups.h"
#include "results/database/schema.h"

namespace dreamsearch::results {

double TimeUse::SecondsFor1000Steps(const std::string& activity) const {
  const auto found = seconds.find(activity);
  return found == seconds.end() ? 0 : 1000 * found->second / env_steps;
}

std::vector<TimeUse> ReadTimeUse(const std::vector<std::unique_ptr<Database>>& databases,
                                 const RunFilter& filter) {
  const std::vector<RunGroup> groups = GroupRuns(databases, filter, CurvePhase::kEvaluation);
  std::vector<TimeUse> uses;
  for (const std::string& label : OrderedLabels(groups)) {
    TimeUse use;
    use.label = label;
    for (const RunGroup& group : groups) {
      if (group.label != label) continue;
      for (const GroupedRun& item : group.runs) {
        Statement rows = item.database->connection().Prepare(
            "SELECT activity, seconds, env_step FROM time_use WHERE run_id = ?1 AND env_step ="
            " (SELECT max(env_step) FROM time_use WHERE run_id = ?1)");
        rows.Bind(item.run.run_id);
        double env_steps = 0;
        while (rows.Step()) {
          use.seconds[rows.Text(0)] += rows.Real(1);
          env_steps = rows.Real(2);
        }
        use.env_steps += env_steps;
        use.runs += env_steps > 0 ? 1 : 0;
      }
    }
    if (use.env_steps > 0) uses.push_back(std::move(use));
  }
  return uses;
}

Table TimeTable(const std::vector<TimeUse>& uses) {
  Table table = {{"line", "runs", "activity", "seconds_for_1000_env_steps"}, {}};
  for (const TimeUse& use : uses) {
    for (const char* activity : kActivities) {
      if (use.seconds.count(activity) == 0) continue;
      table.rows.push_back(
          {use.label, use.runs, std::string(activity), use.SecondsFor1000Steps(activity)});
    }
  }
  return table;
}

}  // namespace dreamsearch::results
