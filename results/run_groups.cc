#include "results/run_groups.h"

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "results/table.h"

namespace dreamsearch::results {
namespace {

constexpr std::array kPaperOrder = {"dreamer", "rollout", "mcts_pw", "mcts_fixed"};

std::size_t PaperRank(const std::string& planner) {
  return static_cast<std::size_t>(std::find(kPaperOrder.begin(), kPaperOrder.end(), planner) -
                                  kPaperOrder.begin());
}

bool HasEpisodes(Connection& db, std::int64_t run_id, int phase) {
  Statement found = db.Prepare("SELECT 1 FROM episode WHERE run_id = ?1 AND phase = ?2 LIMIT 1");
  return found.Bind(run_id, phase).Step();
}

// "k=5" for the settings in which a configuration differs from some other one of
// the same planner and task.
std::map<std::string, std::string> ConfigLabels(const std::map<std::string, std::string>& configs) {
  std::map<std::string, std::string> labels;
  if (configs.size() < 2) return labels;
  std::map<std::string, std::set<std::string>> values;
  std::map<std::string, nlohmann::json> flat;
  for (const auto& [id, json] : configs) {
    const nlohmann::json parsed = nlohmann::json::parse(json, nullptr, false);
    flat[id] = parsed.is_structured() ? parsed.flatten() : nlohmann::json::object();
    for (const auto& [key, value] : flat[id].items()) values[key].insert(value.dump());
  }
  for (const auto& [id, settings] : flat) {
    std::string label;
    for (const auto& [key, seen] : values) {
      const bool everywhere =
          std::all_of(flat.begin(), flat.end(),
                      [&key = key](const auto& other) { return other.second.contains(key); });
      if ((seen.size() < 2 && everywhere) || !settings.contains(key)) continue;
      std::string name = key.substr(1);
      std::replace(name.begin(), name.end(), '/', '.');
      label += (label.empty() ? "" : " ") + name + "=" + settings[key].dump();
    }
    labels[id] = label.empty() ? "config " + id.substr(0, 8) : label;
  }
  return labels;
}

}  // namespace

CurvePhase ParseCurvePhase(const std::string& name) {
  if (name == "evaluation") return CurvePhase::kEvaluation;
  if (name == "training" || name == "0") return CurvePhase::kTraining;
  if (name == "search" || name == "1") return CurvePhase::kSearchEvaluation;
  if (name == "actor" || name == "2") return CurvePhase::kActorEvaluation;
  throw Error(kExitUsage, "no phase '" + name +
                              "'. Known: evaluation (search where there is one, else actor), "
                              "training (0), search (1), actor (2)");
}

bool PlannerBefore(const std::string& a, const std::string& b) {
  return std::pair(PaperRank(a), a) < std::pair(PaperRank(b), b);
}

std::string Unfinished(const RunInfo& run) {
  if (run.status == RunStatus::kFinished) return "";
  return "seed " + std::to_string(run.seed) + " " + RunStatusName(run.status) + " at " +
         Grouped(run.env_steps_done) + " of " + Grouped(run.env_steps_target) + " steps";
}

std::vector<RunGroup> GroupRuns(const std::vector<std::unique_ptr<Database>>& databases,
                                const RunFilter& filter, CurvePhase phase) {
  std::vector<GroupedRun> all;
  std::set<std::string> uuids, studies, models;
  std::set<std::int64_t> repeats;
  RunFilter mains = filter;
  mains.with_evaluations = false;
  for (const auto& database : databases) {
    for (RunInfo& run : database->ListRuns(mains)) {
      if (!uuids.insert(run.uuid).second) continue;
      studies.insert(run.study);
      models.insert(run.model);
      repeats.insert(run.action_repeat);
      all.push_back({std::move(run), database.get()});
    }
  }

  // Configurations are told apart by content, so that databases agree on them.
  std::map<std::pair<std::string, std::string>, std::map<std::string, std::string>> configs;
  for (const GroupedRun& item : all) {
    configs[{item.run.task, item.run.planner}][item.run.config_sha256] = item.run.config_json;
  }
  std::map<std::pair<std::string, std::string>, std::map<std::string, std::string>> config_labels;
  for (const auto& [key, by_sha] : configs) config_labels[key] = ConfigLabels(by_sha);

  std::map<std::tuple<std::string, std::size_t, std::string, std::string>, RunGroup> groups;
  for (GroupedRun& item : all) {
    const RunInfo& run = item.run;
    Connection& db = item.database->connection();
    if (phase == CurvePhase::kSearchEvaluation) item.phase = 1;
    if (phase == CurvePhase::kActorEvaluation) item.phase = 2;
    if (phase == CurvePhase::kEvaluation) item.phase = HasEpisodes(db, run.run_id, 1) ? 1 : 2;

    std::string label = run.planner;
    if (models.size() > 1) label += " on " + run.model;
    if (repeats.size() > 1) label += " repeat=" + std::to_string(run.action_repeat);
    const auto& labels = config_labels[{run.task, run.planner}];
    const auto own = labels.find(run.config_sha256);
    if (own != labels.end()) label += " " + own->second;
    if (studies.size() > 1) label += " (" + run.study + ")";

    RunGroup& group = groups[{run.task, PaperRank(run.planner), run.planner, label}];
    if (group.runs.empty()) {
      group.task = run.task;
      group.planner = run.planner;
      group.label = label;
      Statement range = db.Prepare("SELECT return_low, return_high FROM task WHERE name = ?1");
      if (range.Bind(run.task).Step()) {
        group.return_low = range.OptionalReal(0);
        group.return_high = range.OptionalReal(1);
      }
    }
    group.runs.push_back(std::move(item));
  }

  std::vector<RunGroup> ordered;
  for (auto& [key, group] : groups) {
    std::stable_sort(
        group.runs.begin(), group.runs.end(),
        [](const GroupedRun& a, const GroupedRun& b) { return a.run.seed < b.run.seed; });
    ordered.push_back(std::move(group));
  }
  return ordered;
}

}  // namespace dreamsearch::results
