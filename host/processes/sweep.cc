#include "host/processes/sweep.h"

#include <algorithm>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>

#include "host/plugins/catalogue.h"
#include "host/saving/checkpoint.h"
#include "host/training/provenance.h"
#include "host/training/resumption.h"
#include "results/system/file.h"
#include "results/system/json_text.h"
#include "results/system/sha256.h"

namespace dreamsearch {
namespace {

// A run's RunSpec as JSON, and with these keys what it records.
constexpr char kSpecFile[] = "run.json";
constexpr char kLogDecisions[] = "log_decisions";
constexpr char kRecordTrees[] = "record_trees";

// The run.json in a run's folder; not an object if it is gone or damaged.
nlohmann::json ReadSpec(const std::filesystem::path& folder) {
  std::ifstream file(folder / kSpecFile);
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  return results::ParseJsonOrDiscard(text);
}

// A member if it is there and of that type.
bool Flag(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_boolean() && found->get<bool>();
}

std::string PluginChange(const PluginInfo& now, const std::string& then) {
  return "plugin " + now.name + " changed (" + now.path + ": SHA-256 " +
         (then.empty() ? "of another plugin" : then.substr(0, 12)) + " then, " +
         now.sha256.substr(0, 12) + " now)";
}

// Which of the run's plugins is not the one it was begun with; empty if none. `then`:
// SHA-256 by name, as in a checkpoint's header.
std::string ChangedPlugin(const std::map<std::string, std::string>& then, const RunSpec& spec) {
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    const PluginInfo& now = component->info->plugin;
    const auto before = then.find(now.name);
    if (before == then.end()) return PluginChange(now, "");
    if (before->second != now.sha256) return PluginChange(now, before->second);
  }
  return "";
}

// The same by the run's row, which knows three of them.
std::string ChangedPlugin(results::Database* database, const results::RunInfo& run,
                          const RunSpec& spec) {
  const std::pair<std::optional<std::int64_t>, const ResolvedComponent*> plugins[] = {
      {run.env_plugin, &spec.environment},
      {run.model_plugin, &spec.model},
      {run.planner_plugin, &spec.planner}};
  for (const auto& [plugin_id, component] : plugins) {
    if (!plugin_id) continue;
    const std::string before = database->GetPlugin(*plugin_id).sha256;
    const PluginInfo& now = component->info->plugin;
    if (before != now.sha256) return PluginChange(now, before);
  }
  return "";
}

// Why an unfinished run cannot go on.
struct Obstacle {
  ExitCode code = ExitCode::kPluginRefused;
  std::string why;
};

// The obstacle if there is one. Reads no more of the checkpoints than it must: the worker
// reads them whole, and finds what is damaged. If they are to be given up (`replace`) this
// must find it.
std::optional<Obstacle> ObstacleOf(results::Database* database, const results::RunInfo& run,
                                   const RunSpec& spec, bool replace) {
  const auto other_plugin = [&](const std::string& changed) {
    return Obstacle{ExitCode::kPluginRefused,
                    replace ? changed
                            : "it was begun with another plugin: " + changed +
                                  ". Use --replace to start it over, or another --study"};
  };
  if (const std::string changed = ChangedPlugin(database, run, spec); !changed.empty()) {
    return other_plugin(changed);
  }
  const std::filesystem::path folder = database->RunFolder(run);
  bool recorded = false;
  try {
    std::map<std::string, std::string> then;
    const RunSpec before = RunSpecFromJson(ReadSpec(folder));
    for (const ResolvedComponent* component : ComponentsOf(before)) {
      then[component->info->plugin.name] = component->info->plugin.sha256;
    }
    if (const std::string changed = ChangedPlugin(then, spec); !changed.empty()) {
      return other_plugin(changed);
    }
    recorded = true;
  } catch (const Failure&) {
    // No readable run.json: its process was killed before it was there. It is written anew.
  }
  try {
    const Resumption resumption = FindResumption(
        database, run, spec, folder,
        replace ? CheckpointFolder::Extent::kWhole : CheckpointFolder::Extent::kOutline);
    if (!resumption.checkpoint) return std::nullopt;
    const auto header = resumption.checkpoint->checkpoint.Value<CheckpointHeader>(kHeaderPart);
    if (!recorded) {
      const std::string changed = ChangedPlugin(header.plugins, spec);
      if (!changed.empty()) return other_plugin(changed);
    }
    if (replace && header.instruction_set != InstructionSetInUse()) {
      return Obstacle{ExitCode::kPluginRefused,
                      "its checkpoint was made with another instruction set"};
    }
  } catch (const Failure& error) {
    return Obstacle{error.code(), error.what()};
  }
  return std::nullopt;
}

std::int64_t PluginId(results::Database* database, const ResolvedComponent& component) {
  const PluginInfo& plugin = component.info->plugin;
  results::PluginInfo row;
  row.name = plugin.name;
  row.version = plugin.version;
  row.abi = std::to_string(plugin.sdk_major) + "." + std::to_string(plugin.sdk_minor);
  row.file = plugin.path;
  row.sha256 = plugin.sha256;
  return database->Plugin(row);
}

// Gives a run that starts over a folder of this database's own, without the checkpoints,
// trees and run.json of before. What another database's folder has is that one's.
void ClearOwnFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  std::vector<std::filesystem::path> before = {folder / kSpecFile};
  if (!error) {
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      const std::filesystem::path kind = entry.path().extension();
      if (kind == ".ckpt" || kind == ".trees") before.push_back(entry.path());
    }
  }
  for (const std::filesystem::path& path : before) {
    if (!error) std::filesystem::remove(path, error);
  }
  if (!error) return;
  throw Failure(
      error == std::errc::permission_denied ? ExitCode::kPermission : ExitCode::kInputOutput,
      "cannot clear the folder " + folder.string() +
          ", so the run is not started over: " + error.message());
}

// What the run was begun with recording is recorded on, whoever resumes it.
SweepJob JobFor(results::Database* database, const ProcessOptions& options, const RunSpec& spec,
                const results::RunInfo& run) {
  SweepJob job;
  job.label = RunLabel(spec);
  job.work.spec = spec;
  job.work.db = database->path();
  job.work.run_id = run.run_id;
  job.work.folder = database->RunFolder(run);
  // A repetition by `runner verify` has its trained run in another database.
  if (spec.evaluation && spec.evaluation->parent_run_id != 0) {
    job.work.agent_checkpoint = AgentCheckpoint(database, spec);
  }
  job.work.memory_limit_bytes = options.memory_limit_bytes;
  const nlohmann::json before = ReadSpec(job.work.folder);
  job.work.log_decisions = options.log_decisions || Flag(before, kLogDecisions);
  job.work.record_trees = options.record_trees || Flag(before, kRecordTrees);
  return job;
}

void WriteSpec(const WorkerJob& work) {
  std::error_code error;
  std::filesystem::create_directories(work.folder, error);
  if (error) {
    throw Failure(
        error == std::errc::permission_denied ? ExitCode::kPermission : ExitCode::kCannotCreate,
        "cannot create the folder " + work.folder.string() + ": " + error.message());
  }
  nlohmann::json json = ToJson(work.spec);
  json[kLogDecisions] = work.log_decisions;
  json[kRecordTrees] = work.record_trees;
  WriteWholeFile(work.folder / kSpecFile, results::JsonText(json, 2) + "\n");
}

}  // namespace

results::RunKey KeyOf(const RunSpec& spec) {
  results::RunKey key;
  key.study = spec.study;
  key.task = spec.environment.name();
  key.planner = spec.planner.name();
  key.model = spec.model.name();
  key.config_sha256 = ConfigurationSha256(spec);
  key.seed = static_cast<std::int64_t>(spec.seed);
  key.action_repeat = spec.action_repeat();
  if (spec.evaluation && spec.evaluation->parent_run_id != 0) {
    key.parent_run_id = spec.evaluation->parent_run_id;
  }
  return key;
}

std::string RunLabel(const RunSpec& spec) {
  std::string label = spec.evaluation ? "evaluation of " : "";
  label += spec.environment.name() + " " + spec.planner.name();
  const bool unnamed = spec.model.Has(kDefault) && spec.model.Has(kLearns);
  if (!unnamed) label += " on " + spec.model.name();
  return label + " seed " + std::to_string(spec.seed);
}

bool IsWork(Action action) {
  return action == Action::kStart || action == Action::kResume || action == Action::kStartOver;
}

std::vector<PlannedRun> PlanSweep(results::Database* database, const ProcessOptions& options,
                                  const std::vector<RunSpec>& specs) {
  std::vector<PlannedRun> planned;
  for (const RunSpec& spec : specs) {
    PlannedRun run;
    run.spec = spec;
    const std::optional<results::RunInfo> found =
        database != nullptr ? database->FindRun(KeyOf(spec)) : std::nullopt;
    if (found) {
      run.run_id = found->run_id;
      const std::filesystem::path folder = database->RunFolder(*found);
      const bool failed = found->status == results::RunStatus::kFailed ||
                          found->status == results::RunStatus::kCrashed ||
                          found->status == results::RunStatus::kDiverged;
      if (found->status == results::RunStatus::kFinished) {
        run.action = Action::kSkipFinished;
      } else if (RunIsLocked(folder)) {
        run.action = Action::kSkipActive;
        run.note = "another process is working on it";
      } else if (failed && !options.retry) {
        run.action = Action::kSkipFailed;
        run.note = std::string(results::RunStatusName(found->status)) + " before (" + found->error +
                   "); --retry runs it again";
      } else if (const auto obstacle = ObstacleOf(database, *found, spec, options.replace);
                 !obstacle) {
        run.action = Action::kResume;
        run.note = spec.evaluation
                       ? "from its last recorded episode"
                       : "from environment step " + std::to_string(found->env_steps_done);
      } else {
        run.action = options.replace ? Action::kStartOver : Action::kRefused;
        run.note = obstacle->why;
        run.refusal = obstacle->code;
      }
    }
    planned.push_back(std::move(run));
  }
  return planned;
}

std::vector<SweepJob> RecordSweep(results::Database* database, const ProcessOptions& options,
                                  const std::vector<PlannedRun>& runs,
                                  const std::vector<results::TaskInfo>& tasks,
                                  const std::vector<std::string>& argv) {
  std::vector<SweepJob> jobs;
  const std::int64_t build_id = database->Build(ThisBuild());
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const PlannedRun& run = runs[i];
    const RunSpec& spec = run.spec;
    if (!IsWork(run.action)) continue;
    if (run.action == Action::kResume) {
      // With its run.json: a kill may have come between the row and the file.
      jobs.push_back(JobFor(database, options, spec, *database->GetRun(run.run_id)));
      WriteSpec(jobs.back().work);
      continue;
    }
    results::NewRun row;
    row.study_id = database->Study(spec.study);
    row.task_id = database->Task(tasks[i]);
    row.planner = spec.planner.name();
    row.model = spec.model.name();
    row.env_plugin = PluginId(database, spec.environment);
    row.model_plugin = PluginId(database, spec.model);
    row.planner_plugin = PluginId(database, spec.planner);
    row.config_id = database->Config(CanonicalJson(spec));
    row.preset = spec.preset;
    row.seed = static_cast<std::int64_t>(spec.seed);
    row.action_repeat = spec.action_repeat();
    row.env_steps_target =
        static_cast<std::int64_t>(spec.evaluation ? spec.evaluation->env_step : spec.steps());
    row.parent_run_id = KeyOf(spec).parent_run_id;
    row.argv = results::JsonText(nlohmann::json(argv));
    row.build_id = build_id;
    std::int64_t run_id = run.run_id;
    if (run.action == Action::kStartOver) {
      ClearOwnFolder(database->OwnFolder(*database->GetRun(run_id)));
      database->ReplaceRun(run_id, row);
    } else {
      run_id = database->CreateRun(row).run_id;
    }
    jobs.push_back(JobFor(database, options, spec, *database->GetRun(run_id)));
    WriteSpec(jobs.back().work);
  }
  return jobs;
}

int SayLeftAlone(results::Database* database, const std::vector<PlannedRun>& planned) {
  int failed_before = 0;
  for (const PlannedRun& run : planned) {
    if (run.action == Action::kSkipFailed && failed_before == 0) {
      failed_before = FailureCode(*database->GetRun(run.run_id));
    }
    if (!IsWork(run.action) && run.action != Action::kSkipFinished) {
      std::cerr << (run.action == Action::kRefused ? "refused: " : "left alone: ")
                << RunLabel(run.spec) << ": " << run.note << "\n";
    }
  }
  return failed_before;
}

int SweepStatus(const std::vector<PlannedRun>& planned, const SweepResult& result) {
  const auto refused = std::find_if(planned.begin(), planned.end(), [](const PlannedRun& run) {
    return run.action == Action::kRefused;
  });
  return refused != planned.end() && result.exit_status != static_cast<int>(ExitCode::kInterrupted)
             ? static_cast<int>(refused->refusal)
             : result.exit_status;
}

RunSpec RecordedSpec(results::Database* database, const results::RunInfo& run) {
  const std::filesystem::path folder = database->RunFolder(run);
  const std::filesystem::path path = folder / kSpecFile;
  if (!std::filesystem::exists(path)) {
    const bool finished = run.status == results::RunStatus::kFinished;
    throw Failure(
        ExitCode::kNotFound,
        "the files of run " + std::to_string(run.run_id) + " are gone: expected " + path.string() +
            ". Put the folder " + folder.string() + " back from where " + database->path() +
            " came from, or " +
            (finished ? "delete the run with `results delete` and give its command again: "
                      : "give the command that began it again, with --retry --replace if it had a "
                        "checkpoint: ") +
            run.argv);
  }
  try {
    return RunSpecFromJson(ReadSpec(folder));
  } catch (const Failure& error) {
    throw Failure(ExitCode::kBadInput, "run " + std::to_string(run.run_id) + ": " + path.string() +
                                           " is not what `runner` wrote: " + error.what());
  }
}

std::string ChangedFile(const RunSpec& spec) {
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    const PluginInfo& plugin = component->info->plugin;
    const std::string now = Sha256HexOfFile(plugin.path);
    if (now != plugin.sha256) {
      return plugin.path + " (SHA-256 " + plugin.sha256.substr(0, 12) + " then, " +
             now.substr(0, 12) + " now)";
    }
  }
  return "";
}

std::filesystem::path AgentCheckpoint(results::Database* database, const RunSpec& spec) {
  if (!spec.evaluation || spec.evaluation->parent_uuid.empty()) return {};
  const results::RunInfo parent = database->GetRun(spec.evaluation->parent_uuid);
  return CheckpointFolder(database->RunFolder(parent)).PathOf(spec.evaluation->env_step);
}

SweepJob RecordedJob(results::Database* database, const ProcessOptions& options,
                     const results::RunInfo& run) {
  const RunSpec spec = RecordedSpec(database, run);
  if (const std::string changed = ChangedFile(spec); !changed.empty()) {
    throw Failure(ExitCode::kPluginRefused,
                  "run " + std::to_string(run.run_id) + " was begun with another " + changed +
                      ". Give its command again with --replace to start it over, or with "
                      "another --study");
  }
  FindResumption(database, run, spec, database->RunFolder(run), CheckpointFolder::Extent::kOutline);
  return JobFor(database, options, spec, run);
}

}  // namespace dreamsearch
