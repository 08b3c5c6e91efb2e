#include "results/analysis/run_groups.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <tuple>

#include "results/database/query.h"
#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/shell.h"
#include "results/text/table.h"
#include "results/text/text.h"
#include "results/upkeep/same_run.h"

namespace dreamsearch::results {
namespace {

// Place of each planner in the order in which they were first recorded, whatever the filter:
// so a planner has the same place, and the same colour, in every figure of these databases.
std::map<std::string, std::size_t> PlannerRanks(
    const std::vector<std::unique_ptr<Database>>& databases) {
  // Of one moment the databases' order and the runs' numbers decide.
  using First = std::tuple<std::string, std::size_t, std::int64_t>;
  std::map<std::string, First> firsts;
  for (std::size_t i = 0; i < databases.size(); ++i) {
    Statement rows = databases[i]->connection().Prepare(
        "SELECT planner, min(created_utc), run_id FROM run GROUP BY planner");
    while (rows.Step()) {
      const First first(rows.Text(1), i, rows.Int(2));
      const auto [found, added] = firsts.emplace(rows.Text(0), first);
      if (!added) found->second = std::min(found->second, first);
    }
  }
  std::vector<std::pair<First, std::string>> order;
  for (const auto& [planner, first] : firsts) order.emplace_back(first, planner);
  std::sort(order.begin(), order.end());
  std::map<std::string, std::size_t> ranks;
  for (const auto& [first, planner] : order) ranks.emplace(planner, ranks.size());
  return ranks;
}

// A score is a share of its task's range, and a return is that of its task.
void CheckTasks(const std::vector<GroupedRun>& runs) {
  std::map<std::string, std::pair<Database*, std::vector<Cell>>> tasks;
  std::set<std::pair<std::string, Database*>> read;
  for (const GroupedRun& item : runs) {
    if (!read.emplace(item.run.task, item.database).second) continue;
    Statement row = item.database->connection().Prepare(
        "SELECT domain, observation_size, action_size, control_seconds, substeps, episode_steps,"
        " return_low, return_high FROM task WHERE name = ?1");
    if (!row.Bind(item.run.task).Step()) continue;
    const auto [first, added] =
        tasks.emplace(item.run.task, std::pair(item.database, ReadCells(row)));
    if (added || first->second.second == ReadCells(row)) continue;
    throw Failure(ExitCode::kBadInput,
                  item.database->path() + ": task '" + Printable(item.run.task) +
                      "' has other values here than in " + first->second.first->path() +
                      ". Runs of both must not be averaged: name one of the two with --db.");
  }
}

bool IsEvaluation(const RunInfo& run) {
  return run.parent_run_id.has_value() || run.env_steps_target <= 0;
}

using Kind = std::pair<std::string, bool>;  // planner, whether it is an evaluation

Kind KindOf(const RunInfo& run) { return {run.planner, IsEvaluation(run)}; }

using KindOnModel = std::pair<Kind, std::string>;  // two models have other settings anyway

KindOnModel KindOnModelOf(const RunInfo& run) { return {KindOf(run), run.model}; }

// DottedValues, by the configuration's digest.
using Settings = std::map<std::string, std::map<std::string, std::string>>;

// The settings in which some of these configurations differ.
void AddDifferences(const Settings& settings, const std::set<std::string>& configs,
                    std::set<std::string>* keys) {
  std::map<std::string, std::pair<std::size_t, std::set<std::string>>> seen;  // how often, values
  for (const std::string& config : configs) {
    for (const auto& [key, value] : settings.at(config)) {
      ++seen[key].first;
      seen[key].second.insert(value);
    }
  }
  for (const auto& [key, found] : seen) {
    if (found.first < configs.size() || found.second.size() > 1) keys->insert(key);
  }
}

std::string SettingLabel(const std::map<std::string, std::string>& settings,
                         const std::set<std::string>& keys) {
  std::string label;
  for (const std::string& key : keys) {
    const auto found = settings.find(key);
    if (found == settings.end()) continue;
    label += (label.empty() ? "" : " ") + key + "=" + found->second;
  }
  return label;
}

enum class Loaded { kVersion, kBuild };

// Adds what runs were loaded from, where runs of the planner differ in it: versions of its plugin
// or of a model's, on whatever task, and of a task's; or builds of one version of a plugin.
void AddLoaded(const std::vector<const RunInfo*>& runs, Loaded what,
               std::vector<std::string>* labels) {
  constexpr const char* kComponents[] = {"environment", "model", "planner"};
  constexpr std::size_t kDigits = 8;  // of a digest that are shown
  const auto value = [what](const LoadedPlugin& plugin) {
    return what == Loaded::kVersion ? plugin.version : plugin.sha256;
  };
  using Component = std::pair<Kind, std::size_t>;
  std::map<std::tuple<Component, std::string, std::string>, std::set<std::string>> values;
  for (const RunInfo* run : runs) {
    for (std::size_t i = 0; i < run->loaded.size(); ++i) {
      const LoadedPlugin& plugin = run->loaded[i];
      const Component component(KindOf(*run), i);
      // Models have other plugins because they are other models; tasks likewise.
      const std::string names[] = {run->task, run->model, run->planner};
      values[what == Loaded::kVersion ? std::tuple(component, names[i], std::string())
                                      : std::tuple(component, plugin.name, plugin.version)]
          .insert(value(plugin));
    }
  }
  std::set<Component> differ;
  for (const auto& [among, found] : values) {
    if (found.size() > 1) differ.insert(std::get<0>(among));
  }
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (std::size_t i = 0; i < runs[r]->loaded.size(); ++i) {
      const std::string text = value(runs[r]->loaded[i]);
      if (text.empty() || differ.count({KindOf(*runs[r]), i}) == 0) continue;
      std::string& label = (*labels)[r];
      label += (label.empty() ? "" : " ") + std::string(kComponents[i]) +
               (what == Loaded::kVersion ? ".version=" + JsonText(text)
                                         : ".build=" + JsonText(text.substr(0, kDigits)));
    }
  }
}

// For each label of these runs, the most builds that it has of one version of a plugin.
std::map<std::string, std::size_t> BuildsOf(const std::vector<GroupedRun>& runs,
                                            const std::vector<std::string>& labels) {
  std::map<std::tuple<std::string, std::string, std::string>, std::set<std::string>> digests;
  std::map<std::string, std::size_t> most;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const LoadedPlugin& plugin : runs[r].run.loaded) {
      std::set<std::string>& found = digests[{labels[r], plugin.name, plugin.version}];
      found.insert(plugin.sha256);
      most[labels[r]] = std::max(most[labels[r]], found.size());
    }
  }
  return most;
}

}  // namespace

std::vector<std::string> SettingLabels(const std::vector<const RunInfo*>& runs, Apart apart) {
  // Configurations are told apart by content, so that databases agree on them.
  std::map<KindOnModel, std::map<std::string, std::set<std::string>>> kinds;  // configs by task
  Settings settings;
  for (const RunInfo* run : runs) {
    kinds[KindOnModelOf(*run)][run->task].insert(run->config_sha256);
    if (settings.contains(run->config_sha256)) continue;
    settings[run->config_sha256] = DottedValues(ParseJsonOrDiscard(run->config_json));
  }

  // One choice of keys for all tasks, so that one more setting tried on one of them
  // renames the planner's runs on all.
  std::map<KindOnModel, std::map<std::string, std::string>> labels;  // by configuration
  for (const auto& [kind, tasks] : kinds) {
    std::set<std::string> keys;
    for (const auto& [task, configs] : tasks) AddDifferences(settings, configs, &keys);
    std::set<std::string> alike;
    for (const auto& [task, configs] : tasks) {
      std::map<std::string, std::string> owners;
      for (const std::string& config : configs) {
        const std::string label = SettingLabel(settings[config], keys);
        labels[kind][config] = label;
        const auto [owner, first] = owners.emplace(label, config);
        if (!first) alike.insert({owner->second, config});
      }
    }
    // Settings that cannot be read.
    for (const std::string& config : alike) {
      std::string& label = labels[kind][config];
      label += (label.empty() ? "config " : " config ") + config.substr(0, 8);
    }
  }
  std::vector<std::string> texts;
  for (const RunInfo* run : runs) {
    texts.push_back(labels[KindOnModelOf(*run)][run->config_sha256]);
  }
  if (apart != Apart::kSettings) AddLoaded(runs, Loaded::kVersion, &texts);
  if (apart == Apart::kBuilds) AddLoaded(runs, Loaded::kBuild, &texts);
  return texts;
}

std::string ShortLabel(const std::string& label) {
  std::vector<std::string> whole, brief;
  std::map<std::string, int> names;
  std::istringstream parts(label);
  std::string part, text;
  while (parts >> part) {
    const std::size_t equals = part.find('=');
    const bool setting = equals != std::string::npos && part[0] != '(';
    const std::size_t dot = setting ? part.rfind('.', equals) : std::string::npos;
    whole.push_back(part);
    brief.push_back(dot == std::string::npos ? part : part.substr(dot + 1));
    ++names[brief.back().substr(0, brief.back().find('='))];
  }
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const bool alone = names[brief[i].substr(0, brief[i].find('='))] == 1;
    text += (text.empty() ? "" : " ") + (alone ? brief[i] : whole[i]);
  }
  return text;
}

int PhaseOf(Connection& db, std::int64_t run_id, CurvePhase phase) {
  switch (phase) {
    case CurvePhase::kTraining:
      return 0;
    case CurvePhase::kSearchEvaluation:
      return 1;
    case CurvePhase::kActorEvaluation:
      return 2;
    case CurvePhase::kEvaluation:
      break;
  }
  Statement found = db.Prepare("SELECT 1 FROM episode WHERE run_id = ?1 AND phase = 1 LIMIT 1");
  return found.Bind(run_id).Step() ? 1 : 2;
}

std::string NothingToGroup(const std::vector<std::unique_ptr<Database>>& databases,
                           const RunFilter& filter) {
  std::int64_t evaluations = 0;
  for (const auto& database : databases) {
    evaluations += static_cast<std::int64_t>(database->ListRuns(filter).size());
  }
  const std::string path = databases.front()->path();
  if (evaluations == 0) {
    return path + ": no run matches. " + CommandOn("results list", path) + " shows all.";
  }
  return path + ": only trained runs have curves and scores, and none matches. Found " +
         GroupDigits(evaluations) + (evaluations == 1 ? " evaluation" : " evaluations") +
         ". `results list` and `results show RUN` show their returns, `results export --rows "
         "episodes` gives them.";
}

std::vector<std::string> OrderedLabels(const std::vector<RunGroup>& groups) {
  std::set<std::pair<std::size_t, std::string>> labels;
  for (const RunGroup& group : groups) labels.emplace(group.planner_rank, group.label);
  std::vector<std::string> ordered;
  for (const auto& [rank, label] : labels) ordered.push_back(label);
  return ordered;
}

std::string Unfinished(const RunInfo& run) {
  if (run.status == RunStatus::kFinished) return "";
  return std::string(RunStatusName(run.status)) + " at " + GroupDigits(run.env_steps_done) +
         " of " + GroupDigits(run.env_steps_target) + " steps";
}

std::vector<GroupedRun> TrainedRuns(const std::vector<std::unique_ptr<Database>>& databases,
                                    const RunFilter& filter) {
  RunFilter trained = filter;
  trained.with_evaluations = false;
  std::vector<GroupedRun> runs;
  std::map<std::string, std::size_t> by_uuid;
  std::map<ExperimentKey, std::size_t> by_key;
  for (const auto& database : databases) {
    for (RunInfo& run : database->ListRuns(trained)) {
      auto found = by_uuid.find(run.uuid);
      const bool twice = found == by_uuid.end() && by_key.count(KeyOf(run)) > 0;
      if (found == by_uuid.end() && !twice) {
        by_uuid[run.uuid] = by_key[KeyOf(run)] = runs.size();
        runs.push_back({std::move(run), database.get()});
        continue;
      }
      const std::size_t place = twice ? by_key.at(KeyOf(run)) : found->second;
      GroupedRun& there = runs[place];
      if (twice) there.notes.push_back(RunTwice(run, there.run));
      by_uuid[run.uuid] = place;
      if (!StaysOver(run, there.run)) continue;
      there.run = std::move(run);
      there.database = database.get();
    }
  }
  CheckTasks(runs);
  return runs;
}

std::vector<RunGroup> GroupRuns(const std::vector<std::unique_ptr<Database>>& databases,
                                const RunFilter& filter, CurvePhase phase) {
  std::vector<GroupedRun> all = TrainedRuns(databases, filter);
  std::set<std::string> studies, models;
  std::map<std::pair<std::string, std::string>, std::set<std::int64_t>> repeats;  // of a task
  for (const GroupedRun& item : all) {
    studies.insert(item.run.study);
    models.insert(item.run.model);
    repeats[{item.run.planner, item.run.task}].insert(item.run.action_repeat);
  }
  std::set<std::string> repeats_differ;  // planners
  for (const auto& [planner_task, seen] : repeats) {
    if (seen.size() > 1) repeats_differ.insert(planner_task.first);
  }
  std::vector<const RunInfo*> runs;
  for (const GroupedRun& item : all) runs.push_back(&item.run);
  const std::vector<std::string> settings = SettingLabels(runs, Apart::kVersions);
  std::vector<std::string> labels;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const RunInfo& run = all[i].run;
    std::string& label = labels.emplace_back(run.planner);
    if (models.size() > 1) label += " on " + run.model;
    if (repeats_differ.count(run.planner) > 0) {
      label += " repeat=" + std::to_string(run.action_repeat);
    }
    if (!settings[i].empty()) label += " " + settings[i];
    if (studies.size() > 1) label += " (" + run.study + ")";
  }
  const std::map<std::string, std::size_t> builds = BuildsOf(all, labels);

  const std::map<std::string, std::size_t> ranks = PlannerRanks(databases);
  std::map<std::tuple<std::string, std::size_t, std::string>, RunGroup> groups;
  for (std::size_t i = 0; i < all.size(); ++i) {
    GroupedRun& item = all[i];
    const RunInfo& run = item.run;
    Connection& db = item.database->connection();
    item.phase = PhaseOf(db, run.run_id, phase);

    const std::size_t count = builds.at(labels[i]);
    const std::string label =
        labels[i] + (count > 1 ? " (" + std::to_string(count) + " builds)" : "");
    const std::size_t rank = ranks.at(run.planner);
    RunGroup& group = groups[{run.task, rank, label}];
    if (group.runs.empty()) {
      group.task = run.task;
      group.planner = run.planner;
      group.planner_rank = rank;
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
