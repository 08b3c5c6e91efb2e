#include "results/analysis/missing_runs.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

namespace dreamsearch::results {
namespace {

struct RunsOfLine {
  std::set<std::int64_t> seeds;
  std::string label;
};
using Planner = std::tuple<std::string, std::string>;                       // planner, model
using Place = std::tuple<std::string, std::string, std::string>;            // task, planner, model
using Lines = std::map<std::tuple<std::string, std::int64_t>, RunsOfLine>;  // digest, repeat

struct Study {
  std::set<std::string> tasks;
  std::set<Planner> planners;
  std::set<std::int64_t> seeds;
  std::map<Place, Lines> places;
};

template <typename T>
bool Chosen(const std::vector<T>& list, const T& value) {
  return list.empty() || std::find(list.begin(), list.end(), value) != list.end();
}

}  // namespace

std::vector<MissingRun> MissingRuns(const std::vector<std::unique_ptr<Database>>& databases,
                                    const RunFilter& filter) {
  const std::vector<GroupedRun> runs = TrainedRuns(databases, {.studies = filter.studies});
  std::vector<const RunInfo*> pointers;
  for (const GroupedRun& item : runs) pointers.push_back(&item.run);
  const std::vector<std::string> labels = SettingLabels(pointers, Apart::kSettings);

  std::map<std::string, Study> studies;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const RunInfo& run = runs[i].run;
    Study& study = studies[run.study];
    study.tasks.insert(run.task);
    study.planners.emplace(run.planner, run.model);
    study.seeds.insert(run.seed);
    RunsOfLine& line =
        study.places[{run.task, run.planner, run.model}][{run.config_sha256, run.action_repeat}];
    line.seeds.insert(run.seed);
    line.label = labels[i];
  }

  std::vector<MissingRun> missing;
  for (auto& [name, study] : studies) {
    for (const std::string& task : study.tasks) {
      for (const auto& [planner, model] : study.planners) {
        if (!Chosen(filter.tasks, task) || !Chosen(filter.planners, planner)) continue;
        Lines& lines = study.places[{task, planner, model}];
        if (lines.empty()) lines[{"", 0}];
        std::set<std::int64_t> repeats;
        for (const auto& [key, line] : lines) repeats.insert(std::get<1>(key));
        for (const auto& [key, line] : lines) {
          const auto& [config, repeat] = key;
          std::string settings = line.label;
          if (repeats.size() > 1) {
            settings += (settings.empty() ? "repeat=" : " repeat=") + std::to_string(repeat);
          }
          for (const std::int64_t seed : study.seeds) {
            if (line.seeds.count(seed) > 0 || !Chosen(filter.seeds, seed)) continue;
            missing.push_back({name, task, planner, model, config, repeat, settings, seed});
          }
        }
      }
    }
  }
  return missing;
}

}  // namespace dreamsearch::results
