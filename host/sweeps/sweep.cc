// sweep.cc - over 400 lines: planning, recording and what is refused ask the same questions of a
// run.
#include "host/sweeps/sweep.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "host/plugins/catalogue.h"
#include "host/saving/checkpoint.h"
#include "host/sweeps/recorded_code.h"
#include "host/sweeps/run_file.h"
#include "host/training/build_and_host.h"
#include "host/training/experiment.h"
#include "host/training/resumption.h"
#include "results/system/file.h"
#include "results/system/run_lock.h"
#include "results/text/json_text.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// ChangedPlugin by the run's row, which knows three of its plugins.
std::string ChangedPlugin(results::Database* database, const results::RunInfo& run,
                          const RunSpec& spec) {
  const std::pair<std::optional<std::int64_t>, const ResolvedComponent*> plugins[] = {
      {run.env_plugin, &spec.environment},
      {run.model_plugin, &spec.model},
      {run.planner_plugin, &spec.planner}};
  for (const auto& [plugin_id, component] : plugins) {
    if (!plugin_id) continue;
    std::string change =
        PluginChange(component->info->plugin, database->GetPlugin(*plugin_id).sha256);
    if (!change.empty()) return change;
  }
  return "";
}

// Why an unfinished run cannot be resumed.
struct Obstacle {
  ExitCode code = ExitCode::kPluginRefused;
  std::string why;
};

// The obstacle if there is one. Reads no more of the checkpoints than it must: the worker
// reads them whole, and finds what is damaged. If they are to be given up (`replace`) this
// must find it.
std::optional<Obstacle> ObstacleOf(results::Database* database, const results::RunInfo& run,
                                   const RunSpec& spec, bool replace) {
  const auto other_file = [&](const std::string& changed) {
    return Obstacle{ExitCode::kPluginRefused,
                    replace ? changed
                            : "something changed since it began: " + changed +
                                  ". Use --replace to start it over, or another --study"};
  };
  if (const std::string changed = ChangedPlugin(database, run, spec); !changed.empty()) {
    return other_file(changed);
  }
  const std::filesystem::path folder = database->RunFolder(run);
  bool recorded = false;
  try {
    const std::map<std::string, std::string> then = DigestsOf(ReadRunFile(folder).spec);
    if (const std::string changed = ChangedSince(spec, then); !changed.empty()) {
      return other_file(changed);
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
      const std::string changed = ChangedSince(spec, header.plugins);
      if (!changed.empty()) return other_file(changed);
    }
    if (replace &&
        (header.configuration != ConfigurationSha256(spec) || header.seed != spec.seed)) {
      return Obstacle{ExitCode::kPluginRefused,
                      "its checkpoint was made with another configuration"};
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

// Why a run that is new here should not stand beside the finished ones of its configuration: other
// plugins made them. Empty if there is no reason.
std::string OtherPluginsOfItsKind(results::Database* database, const RunSpec& spec) {
  const results::RunKey key = KeyOf(spec);
  results::RunFilter filter;
  filter.studies = {key.study};
  filter.tasks = {key.task};
  filter.planners = {key.planner};
  filter.statuses = {results::RunStatus::kFinished};
  filter.with_evaluations = false;
  for (const results::RunInfo& run : database->ListRuns(filter)) {
    if (run.model != key.model || run.config_sha256 != key.config_sha256 ||
        run.action_repeat != key.action_repeat) {
      continue;
    }
    const std::string changed = ChangedPlugin(database, run, spec);
    if (changed.empty()) continue;
    return "seed " + std::to_string(run.seed) + " finished before something changed: " + changed +
           ". Use another --study, or --replace to add seeds to it all the same";
  }
  return "";
}

std::int64_t PluginId(results::Database* database, const ResolvedComponent& component) {
  const PluginInfo& plugin = component.info->plugin;
  results::PluginRow row;
  row.name = plugin.name;
  // Whichever of the two its author raised, it is another version.
  const ComponentInfo& made = *component.info;
  row.version = plugin.version +
                (made.version == plugin.version ? "" : " (" + made.name + " " + made.version + ")");
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
  std::vector<std::filesystem::path> before = {folder / kRunFile};
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

// From where the run goes on its training episodes get other seeds.
void AddRetry(const Resumption& resumption, WorkerJob* work) {
  Retry retry;
  retry.number = work->retries.empty() ? 1 : work->retries.back().number + 1;
  retry.episode = static_cast<std::uint64_t>(resumption.point.training_episodes);
  if (resumption.checkpoint && Experiment::IsWithinEpisode(resumption.checkpoint->checkpoint)) {
    ++retry.episode;
    retry.env_step = static_cast<std::uint64_t>(resumption.point.env_step);
  }
  work->retries.push_back(retry);
  work->retried = true;
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
  job.work.nice = options.nice;
  job.work.log_decisions = options.log_decisions;
  job.work.record_trees = options.record_trees;
  job.work.keep_replay = options.keep_replay;
  try {
    const RunFile before = ReadRunFile(job.work.folder);
    job.work.log_decisions = job.work.log_decisions || before.log_decisions;
    job.work.record_trees = job.work.record_trees || before.record_trees;
    job.work.keep_replay = job.work.keep_replay || before.keep_replay;
    job.work.retries = before.retries;
  } catch (const Failure&) {
    // It is new, or its process was killed before the file was there.
  }
  if (options.retry && run.status == results::RunStatus::kDiverged && !spec.evaluation) {
    AddRetry(
        FindResumption(database, run, spec, job.work.folder, CheckpointFolder::Extent::kOutline),
        &job.work);
  }
  return job;
}

}  // namespace

results::RunKey KeyOf(const RunSpec& spec) {
  results::RunKey key;
  key.study = spec.study;
  key.task = spec.environment.task();
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
  label += spec.environment.task() + " " + spec.planner.name();
  const bool unnamed = spec.model.Has(kDefault) && spec.model.Has(kLearns);
  if (!unnamed) label += " on " + spec.model.name();
  return label + " seed " + std::to_string(spec.seed);
}

std::string SilentWorker(results::Database* database, const results::RunInfo& run) {
  // One that never was alive, or is about to be again, has an old heartbeat too.
  constexpr std::chrono::milliseconds kHeartbeats{2500};
  if (!(run.heartbeat_age_seconds > kSilentSeconds) || std::isinf(run.heartbeat_age_seconds)) {
    return "";
  }
  std::this_thread::sleep_for(kHeartbeats);
  const std::optional<results::RunInfo> now = database->GetRun(run.run_id);
  if (!now || now->heartbeat_utc != run.heartbeat_utc || !RunIsLocked(database->RunFolder(run))) {
    return "";
  }
  return database->LastWorker(run.run_id) + " holds it and has recorded nothing for " +
         FormatDuration(run.heartbeat_age_seconds) +
         ". If it hangs or is stopped, end it, and the same command resumes the run";
}

bool IsWork(SweepAction action) {
  return action == SweepAction::kStart || action == SweepAction::kResume ||
         action == SweepAction::kStartOver;
}

std::vector<PlannedRun> PlanSweep(results::Database* database, const ProcessOptions& options,
                                  const std::vector<RunSpec>& specs) {
  std::vector<PlannedRun> planned;
  std::map<std::string, std::string> others;  // OtherPluginsOfItsKind, by configuration
  for (const RunSpec& spec : specs) {
    PlannedRun run;
    run.spec = spec;
    const std::optional<results::RunInfo> found =
        database != nullptr ? database->FindRun(KeyOf(spec)) : std::nullopt;
    if (!found && database != nullptr && !spec.evaluation && !options.replace) {
      // Not of the seed: once for each configuration.
      const std::string kind = spec.study + ' ' + CanonicalJson(spec);
      const auto [entry, added] = others.try_emplace(kind);
      if (added) entry->second = OtherPluginsOfItsKind(database, spec);
      if (!entry->second.empty()) {
        run.action = SweepAction::kRefused;
        run.note = entry->second;
        run.refusal = ExitCode::kPluginRefused;
      }
    }
    if (found) {
      run.run_id = found->run_id;
      const std::filesystem::path folder = database->RunFolder(*found);
      if (found->status == results::RunStatus::kFinished) {
        run.action = SweepAction::kSkipFinished;
        if (const std::string changed = ChangedPlugin(database, *found, spec); !changed.empty()) {
          run.note = "finished before something changed: " + changed +
                     ". With another --study it runs again";
        }
      } else if (RunIsLocked(folder)) {
        const std::string silent = SilentWorker(database, *found);
        run.action = silent.empty() ? SweepAction::kSkipActive : SweepAction::kRefused;
        run.note = silent.empty() ? "another process is working on it" : silent;
        run.refusal = ExitCode::kInputOutput;
      } else if (results::HasFailed(found->status) && !options.retry) {
        // A plugin that was mended since is another one: --replace accepts that, alone.
        const auto obstacle = ObstacleOf(database, *found, spec, /*replace=*/true);
        run.action =
            obstacle && options.replace ? SweepAction::kStartOver : SweepAction::kSkipFailed;
        run.changed = obstacle.has_value();
        run.note = std::string(results::RunStatusName(found->status)) + " before (" + found->error +
                   ")" +
                   (obstacle ? "; since then " + obstacle->why + ": --replace starts it over"
                             : "; --retry runs it again");
      } else if (const auto obstacle = ObstacleOf(database, *found, spec, options.replace);
                 !obstacle) {
        run.action = SweepAction::kResume;
        run.note = spec.evaluation
                       ? "from its last recorded episode"
                       : "from environment step " + std::to_string(found->env_steps_done);
      } else {
        run.action = options.replace ? SweepAction::kStartOver : SweepAction::kRefused;
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
    if (run.action == SweepAction::kResume) {
      // With its run.json: a kill may have come between the row and the file.
      jobs.push_back(JobFor(database, options, spec, *database->GetRun(run.run_id)));
      WriteRunFile(jobs.back().work);
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
    if (run.action == SweepAction::kStartOver) {
      ClearOwnFolder(database->OwnFolder(*database->GetRun(run_id)));
      database->ReplaceRun(run_id, row);
    } else {
      run_id = database->CreateRun(row).run_id;
    }
    jobs.push_back(JobFor(database, options, spec, *database->GetRun(run_id)));
    WriteRunFile(jobs.back().work);
  }
  return jobs;
}

int SaySkipped(results::Database* database, const std::vector<PlannedRun>& planned) {
  int failed_before = 0;
  for (const PlannedRun& run : planned) {
    if (run.action == SweepAction::kSkipFailed && failed_before == 0) {
      failed_before = FailureCode(*database->GetRun(run.run_id));
    }
    if (run.action == SweepAction::kSkipFinished && !run.note.empty()) {
      std::cerr << "note: " << RunLabel(run.spec) << ": " << run.note << "\n";
    } else if (!IsWork(run.action) && run.action != SweepAction::kSkipFinished) {
      std::cerr << (run.action == SweepAction::kRefused ? "refused: " : "skipped: ")
                << RunLabel(run.spec) << ": " << run.note << "\n";
    }
  }
  return failed_before;
}

int SweepStatus(const std::vector<PlannedRun>& planned, const SweepResult& result) {
  const auto refused = std::find_if(planned.begin(), planned.end(), [](const PlannedRun& run) {
    return run.action == SweepAction::kRefused;
  });
  return refused != planned.end() && result.exit_status != static_cast<int>(ExitCode::kInterrupted)
             ? static_cast<int>(refused->refusal)
             : result.exit_status;
}

RunSpec RecordedSpec(results::Database* database, const results::RunInfo& run) {
  const std::filesystem::path folder = database->RunFolder(run);
  const std::filesystem::path path = folder / kRunFile;
  if (!std::filesystem::exists(path)) {
    const bool finished = run.status == results::RunStatus::kFinished;
    throw Failure(
        ExitCode::kNotFound,
        "the files of run " + std::to_string(run.run_id) + " are gone: expected " + path.string() +
            ". Put the folder " + folder.string() + " back from where " + database->path() +
            " came from, or " +
            (finished ? "delete the run with " +
                            CommandOn("results delete " + std::to_string(run.run_id) + " --yes",
                                      database->path()) +
                            " and give its command again: "
                      : "give the command that began it again, with --retry --replace if it had a "
                        "checkpoint: ") +
            ShellCommandOf(run.argv));
  }
  try {
    return ReadRunFile(folder).spec;
  } catch (const Failure& error) {
    throw Failure(error.code(), "run " + std::to_string(run.run_id) + ": " + error.what());
  }
}

RunSpec TrustedSpec(results::Database* database, const results::RunInfo& run,
                    const TrustedCode& trusted) {
  RunSpec spec = RecordedSpec(database, run);
  TrustRecordedCode(trusted, "run " + std::to_string(run.run_id) + " of " + database->path(),
                    &spec);
  return spec;
}

std::filesystem::path AgentCheckpoint(results::Database* database, const RunSpec& spec) {
  if (!spec.evaluation || spec.evaluation->parent_uuid.empty()) return {};
  const results::RunInfo parent = database->GetRun(spec.evaluation->parent_uuid);
  return CheckpointFolder(database->RunFolder(parent)).PathOf(spec.evaluation->env_step);
}

SweepJob RecordedJob(results::Database* database, const ProcessOptions& options,
                     const results::RunInfo& run) {
  const RunSpec spec = TrustedSpec(database, run, options.trusted());
  std::string changed = ChangedFile(spec);
  if (changed.empty()) changed = ChangedIngredient(spec, options);
  if (!changed.empty()) {
    throw Failure(ExitCode::kPluginRefused,
                  "run " + std::to_string(run.run_id) +
                      " cannot resume, because something changed since it began: " + changed +
                      ". Give its command again with --replace to start it over, or with "
                      "another --study");
  }
  FindResumption(database, run, spec, database->RunFolder(run), CheckpointFolder::Extent::kOutline);
  SweepJob job = JobFor(database, options, spec, run);
  if (job.work.retried && !options.dry_run) WriteRunFile(job.work);
  return job;
}

}  // namespace dreamsearch
