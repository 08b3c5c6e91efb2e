#include "sweep.h"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "catalogue.h"
#include "checkpoint.h"
#include "provenance.h"

namespace dreamsearch {
namespace {

constexpr char kSpecFile[] = "run.json";

// Which of the run's plugins is not the one it was begun with; empty if none.
std::string ChangedPlugin(results::Database* database, const results::RunInfo& run,
                          const RunSpec& spec) {
  const std::pair<std::optional<std::int64_t>, const ResolvedComponent*> plugins[] = {
      {run.env_plugin, &spec.environment},
      {run.model_plugin, &spec.model},
      {run.planner_plugin, &spec.planner}};
  for (const auto& [plugin_id, component] : plugins) {
    if (!plugin_id) continue;
    const results::PluginInfo stored = database->GetPlugin(*plugin_id);
    const PluginInfo& now = component->info->plugin;
    if (stored.sha256 != now.sha256) {
      return "plugin " + now.name + " changed (" + now.path + ": SHA-256 " +
             stored.sha256.substr(0, 12) + " then, " + now.sha256.substr(0, 12) + " now)";
    }
  }
  return "";
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

void RemoveCheckpoints(const std::filesystem::path& folder) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".ckpt") std::filesystem::remove(entry.path(), ignored);
  }
}

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
  job.work.log_decisions = options.log_decisions;
  job.work.record_trees = options.record_trees;
  return job;
}

void WriteSpec(const std::filesystem::path& folder, const RunSpec& spec) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  std::ofstream file(folder / kSpecFile, std::ios::trunc);
  file << ToJson(spec).dump(2) << "\n";
  file.close();
  if (!file) {
    throw RunnerError(ExitCode::kCannotCreate,
                      "cannot write " + (folder / kSpecFile).string());
  }
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
  if (spec.model.name() != "dreamer") label += " on " + spec.model.name();
  return label + " seed " + std::to_string(spec.seed);
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
        run.note = std::string(results::RunStatusName(found->status)) + " before (" +
                   found->error + "); --retry runs it again";
      } else if (const std::string changed = ChangedPlugin(database, *found, spec);
                 !changed.empty()) {
        if (!options.replace) {
          throw RunnerError(ExitCode::kPluginRefused,
                            RunLabel(spec) + " was begun with another plugin: " + changed +
                                ". Use --replace to start it over, or another --study");
        }
        run.action = Action::kStartOver;
        run.note = changed;
      } else {
        run.action = Action::kResume;
        run.note = spec.evaluation ? "from its last recorded episode"
                                   : "from environment step " +
                                         std::to_string(found->env_steps_done);
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
    if (run.action == Action::kResume) {
      jobs.push_back(JobFor(database, options, spec, *database->GetRun(run.run_id)));
      continue;
    }
    if (run.action != Action::kStart && run.action != Action::kStartOver) continue;
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
    row.argv = nlohmann::json(argv).dump();
    row.build_id = build_id;
    std::int64_t run_id = run.run_id;
    if (run.action == Action::kStartOver) {
      RemoveCheckpoints(database->RunFolder(*database->GetRun(run_id)));
      database->ReplaceRun(run_id, row);
    } else {
      run_id = database->CreateRun(row).run_id;
    }
    const results::RunInfo recorded = *database->GetRun(run_id);
    WriteSpec(database->RunFolder(recorded), spec);
    jobs.push_back(JobFor(database, options, spec, recorded));
  }
  return jobs;
}

RunSpec RecordedSpec(results::Database* database, const results::RunInfo& run) {
  const std::filesystem::path folder = database->RunFolder(run);
  const std::filesystem::path path = folder / kSpecFile;
  std::ifstream file(path);
  if (!file) {
    const bool finished = run.status == results::RunStatus::kFinished;
    throw RunnerError(
        ExitCode::kNotFound,
        "the files of run " + std::to_string(run.run_id) + " are gone: expected " +
            path.string() + ". Put the folder " + folder.string() + " back from where " +
            database->path() + " came from, or " +
            (finished ? "delete the run with `results delete` and give its command again: "
                      : "give the command that began it again: ") +
            run.argv);
  }
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded()) {
    throw RunnerError(ExitCode::kBadInput, path.string() + " is not what `runner` wrote");
  }
  return RunSpecFromJson(json);
}

std::string ChangedFile(const RunSpec& spec) {
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    const PluginInfo& plugin = component->info->plugin;
    const std::string now = FileSha256(plugin.path);
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
    throw RunnerError(ExitCode::kPluginRefused,
                      "run " + std::to_string(run.run_id) + " was begun with another " + changed +
                          ". Give its command again with --replace to start it over, or with "
                          "another --study");
  }
  return JobFor(database, options, spec, run);
}

}  // namespace dreamsearch
