// runner submit - how are these experiments run on a cluster?
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <set>
#include <utility>

#include "dreamsearch/instruction_set.h"
#include "host/clusters/batch_script.h"
#include "host/clusters/slurm.h"
#include "host/clusters/submission.h"
#include "host/commands/commands.h"
#include "host/flags/flags.h"
#include "host/flags/run_flags.h"
#include "host/plugins/catalogue.h"
#include "host/settings/settings.h"
#include "host/sweeps/sweep.h"
#include "host/training/build_and_host.h"
#include "results/command_line/values.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/run_lock.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// Less, and a task would spend its time on being warned and requeued.
constexpr double kLeastTimeSeconds = 300;

struct Submit {
  RunOptions options;
  std::string folder;
  Allocation allocation;
  std::string extra_file;
  std::string instruction_set;
  std::size_t runs_per_task = 1;
  bool print = false;

  CommandSpec Declare();
  int Run();

 private:
  // What becomes of the runs of the command.
  struct Choice {
    std::vector<const RunSpec*> submitted;
    std::size_t finished = 0;
    std::size_t active = 0;
    std::size_t skipped = 0;
    int exit_status = 0;  // of the first run that was refused or had failed
  };

  void Check();
  BatchPlace Place(const Submission& record) const;
  Queue AskedQueue(const Submission& record) const;
  Choice Choose(const std::vector<RunSpec>& specs, const Queue& queue, Submission* record) const;
  void WriteConfigurations(const std::vector<const RunSpec*>& specs,
                           const Catalogue& catalogue) const;
  std::vector<std::string> TaskFlags() const;
  std::vector<std::string> SubmitArrays(const BatchPlace& place,
                                        const std::vector<const RunSpec*>& specs,
                                        Submission* record) const;
  std::string SubmitMerge(const BatchPlace& place, const Queue& queue,
                          const std::vector<std::string>& added, Submission* record) const;
  // Prints the script or submits it; the job's number, empty if it was printed.
  std::string Hand(const std::string& name, const std::string& script) const;
};

CommandSpec Submit::Declare() {
  CommandSpec runs = RunFlags(&options);
  // Each run has a database and a process of its own, and --time ends it, for a while.
  const std::set<std::string> others = {"db", "jobs", "dry-run", "time-limit"};
  for (FlagGroup& group : runs.groups) {
    std::erase_if(group.flags, [&](const Flag& flag) { return others.contains(flag.name); });
  }
  std::vector<std::string> sets;
  for (const InstructionSet set : kInstructionSets) sets.push_back(InstructionSetName(set));
  std::vector<FlagGroup> groups = {
      {"Where and how Slurm runs it",
       {{"folder", "DIR", Text(&folder).Required(),
         "the sweep's folder, which every node must see: databases, scripts, logs"},
        {"partition", "NAME", Text(&allocation.partition).Default("the site's"),
         "Slurm's partition"},
        {"account", "NAME", Text(&allocation.account).Default("yours"), "Slurm's account"},
        {"time", "TIME", Duration(&allocation.time_seconds).Default("the partition's limit"),
         "time of a task, as 30m or 4h, at least 5m; a run that needs more goes on in the next"},
        {"memory", "SIZE", Size(&allocation.memory_bytes).Default("the site's"),
         "memory of a task, as 512M or 4G"},
        {"cores", "N", Whole(&allocation.cores, 1, 10000), "cores of a task"},
        {"runs-per-task", "K", Whole(&runs_per_task, 1, 100000),
         "runs that a task does one after the other"},
        {"sbatch", "FILE", Text(&extra_file), "more lines of #SBATCH for the scripts"},
        {"instruction-set", "NAME",
         OneOf(&instruction_set, sets).Default("the sweep's, or this machine's"),
         "compute with this on every node, so that each can resume what another began"},
        {"print", "", Switch(&print), "print the batch scripts; write and submit nothing"}}}};
  std::move(runs.groups.begin(), runs.groups.end(), std::back_inserter(groups));
  return {
      .name = "runner submit",
      .summary = "runs experiments on a cluster with Slurm",
      .usage = {"runner submit --env NAMES --planner NAMES --folder DIR [flags]"},
      .examples =
          {"runner submit --env walker_walk --planner dreamer,rollout,mcts_pw --seeds 10 \\",
           "       --folder sweep --partition cpu --time 4h --memory 4G --cores 4",
           "runner status --folder sweep"},
      .about =
          "Each run is a task of an array, with a database of its own in DIR/runs. A last job "
          "merges them into DIR/all.db, writes DIR/report.html, and lists in its log what is not "
          "finished. The command submits and ends; it prints the numbers of the jobs.\n"
          "Slurm warns a task " +
          std::to_string(kNoticeSeconds) +
          " s before its time is over. Its run then has a minute for a checkpoint, and the task "
          "goes back into the queue. So does a task that is pre-empted. A task that was killed "
          "resumes from the run's last checkpoint when it is submitted again.\n"
          "The same command again submits what is missing and skips runs that are finished, "
          "queued, active or, without --retry, failed. More tasks, planners or seeds "
          "add runs to the folder. Settings are checked here, but that an environment can be made "
          "with them only where its run begins. The exit status is that of the first run that was "
          "refused or that failed before and is skipped.",
      .groups = std::move(groups),
      .exclusive = std::move(runs.exclusive)};
}

// The absolute path of a program beside this one.
std::filesystem::path Beside(const char* name) {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
}

void Submit::Check() {
  if (allocation.time_seconds > 0 && allocation.time_seconds < kLeastTimeSeconds) {
    throw Failure(ExitCode::kUsage,
                  "runner submit: --time: expected 5m or more, because Slurm warns up to " +
                      FormatDuration(kNoticeSeconds + kEarlySeconds) + " before the end, found " +
                      FormatDuration(allocation.time_seconds));
  }
  if (!extra_file.empty()) allocation.extra_lines = ExtraLines(extra_file);
  folder = AbsolutePath(folder);
  while (folder.size() > 1 && folder.ends_with('/')) folder.pop_back();
}

BatchPlace Submit::Place(const Submission& record) const {
  return {.folder = folder,
          .working = std::filesystem::current_path(),
          .runner = Beside("runner"),
          .results = Beside("results"),
          .instruction_set = record.instruction_set};
}

Queue Submit::AskedQueue(const Submission& record) const {
  try {
    return AskQueue(record.Jobs());
  } catch (const Failure& error) {
    if (!print) throw;
    std::cerr << "warning: squeue was not asked, so queued runs look missing: " << error.what()
              << "\n";
    return {};
  }
}

Submit::Choice Submit::Choose(const std::vector<RunSpec>& specs, const Queue& queue,
                              Submission* record) const {
  Choice choice;
  for (const RunSpec& spec : specs) {
    const std::string id = RunFileName(spec);
    SubmittedRun* run = record->Run(id);
    run->label = RunLabel(spec);
    run->steps = spec.steps();
    if (queue.contains(run->job)) {
      ++choice.active;
      continue;
    }
    std::vector<PlannedRun> planned(1);
    planned[0].spec = spec;
    const std::filesystem::path path = RunDatabase(folder, id);
    if (std::filesystem::exists(path)) {
      const auto database = results::Database::OpenReadOnly(path.string());
      planned = PlanSweep(database.get(), options.process, {spec});
      const int failed_before = SaySkipped(database.get(), planned);
      const int status = failed_before != 0 ? failed_before : SweepStatus(planned, {});
      if (choice.exit_status == 0) choice.exit_status = status;
    }
    const SweepAction action = planned[0].action;
    if (IsWork(action)) {
      choice.submitted.push_back(&spec);
    } else {
      ++(action == SweepAction::kSkipFinished ? choice.finished
         : action == SweepAction::kSkipActive ? choice.active
                                              : choice.skipped);
    }
  }
  return choice;
}

// A configuration that did not resolve to its run would record another one, and the run would be
// missing for ever.
void Submit::WriteConfigurations(const std::vector<const RunSpec*>& specs,
                                 const Catalogue& catalogue) const {
  for (const RunSpec* spec : specs) {
    const std::string id = RunFileName(*spec);
    const std::filesystem::path path = RunConfiguration(folder, id);
    WriteFile(path.string(), ConfigurationText(*spec));
    std::string found;
    try {
      RunOptions read;
      ReadCommandLine(RunFlags(&read), {"--config", path.string()});
      const std::vector<RunSpec> resolved = ResolveMatrix(read, catalogue);
      if (resolved.size() == 1 && RunFileName(resolved[0]) == id) continue;
      found = "another run";
    } catch (const Failure& error) {
      found = error.what();
    }
    throw Failure(ExitCode::kUsage,
                  "runner submit: expected settings that a configuration file "
                  "can hold (no #, no space at an end) for " +
                      RunLabel(*spec) + ", found: " + found);
  }
}

std::vector<std::string> Submit::TaskFlags() const {
  const ProcessOptions& process = options.process;
  std::vector<std::string> flags = {"--jobs", "1"};
  const auto add = [&](const std::string& name, const std::string& value) {
    flags.insert(flags.end(), {"--" + name, value});
  };
  for (const std::string& path : process.plugin_path) add("plugin-path", AbsolutePath(path));
  if (!process.scratch.empty()) add("scratch", AbsolutePath(process.scratch.string()));
  if (process.nice > 0) add("nice", std::to_string(process.nice));
  if (process.memory_limit_bytes != kShareOfMemory) {
    add("memory-limit", std::to_string(process.memory_limit_bytes));
  }
  add("hang-timeout", ExactText(process.hang_timeout_seconds));
  if (process.replace) flags.push_back("--replace");
  if (process.log_decisions) flags.push_back("--log-decisions");
  if (process.record_trees) flags.push_back("--record-trees");
  if (process.keep_replay) flags.push_back("--keep-replay");
  return flags;
}

std::string Submit::Hand(const std::string& name, const std::string& script) const {
  if (print) {
    std::cout << script << "\n";
    return "";
  }
  const std::filesystem::path path = std::filesystem::path(folder) / "jobs" / (name + ".sh");
  WriteFile(path.string(), script);
  return SubmitScript(path);
}

std::vector<std::string> Submit::SubmitArrays(const BatchPlace& place,
                                              const std::vector<const RunSpec*>& specs,
                                              Submission* record) const {
  std::vector<std::vector<std::string>> tasks;
  for (std::size_t i = 0; i < specs.size(); ++i) {
    if (i % runs_per_task == 0) tasks.emplace_back();
    tasks.back().push_back(RunFileName(*specs[i]));
  }
  std::uint64_t size = kDefaultMaxArraySize;
  try {
    if (!tasks.empty()) size = MaxArraySize();
  } catch (const Failure&) {
    if (!print) throw;
  }
  const auto most = static_cast<std::size_t>(std::max<std::uint64_t>(2, size) - 1);
  std::vector<std::string> jobs;
  for (std::size_t first = 0; first < tasks.size(); first += most) {
    const auto begin = tasks.begin() + static_cast<std::ptrdiff_t>(first);
    const std::vector<std::vector<std::string>> part(
        begin, begin + static_cast<std::ptrdiff_t>(std::min(most, tasks.size() - first)));
    const std::string job =
        Hand("array_" + std::to_string(record->arrays.size() + 1),
             ArrayScript(place, allocation, part, TaskFlags(), options.process.retry));
    if (print) continue;
    record->arrays.push_back(job);
    for (std::size_t task = 0; task < part.size(); ++task) {
      for (const std::string& id : part[task]) {
        record->Run(id)->job = job + "_" + std::to_string(task);
      }
    }
    WriteSubmission(folder, *record);
    jobs.push_back(job);
  }
  return jobs;
}

std::string Submit::SubmitMerge(const BatchPlace& place, const Queue& queue,
                                const std::vector<std::string>& added, Submission* record) const {
  // Those before it too: it is the last to write the merged database.
  std::set<std::string> after(added.begin(), added.end());
  for (const auto& [job, state] : queue) after.insert(job.substr(0, job.find('_')));
  const std::string job = Hand("merge_" + std::to_string(record->arrays.size()),
                               MergeScript(place, allocation, {after.begin(), after.end()}));
  if (print) return "";
  record->merge_job = job;
  WriteSubmission(folder, *record);
  return job;
}

int Submit::Run() {
  Check();
  const Catalogue catalogue = ScanPlugins(options.process.plugin_path);
  const std::vector<RunSpec> specs = ResolveMatrix(options, catalogue);

  FileDescriptor lock;
  if (!print) {
    for (const char* part : {"runs", "jobs", "logs"}) {
      std::error_code error;
      std::filesystem::create_directories(std::filesystem::path(folder) / part, error);
      if (!error) continue;
      throw Failure(
          error == std::errc::permission_denied ? ExitCode::kPermission : ExitCode::kCannotCreate,
          "cannot create the folder " + folder + "/" + part + ": " + error.message());
    }
    if (RunIsLocked(folder)) {
      throw Failure(ExitCode::kInputOutput, "another `runner submit` is at work in " + folder);
    }
    lock = LockRun(folder);
  }
  Submission record = ReadSubmission(folder);
  if (record.instruction_set.empty()) {
    record.instruction_set = instruction_set.empty() ? InstructionSetInUse() : instruction_set;
  } else if (!instruction_set.empty() && instruction_set != record.instruction_set) {
    throw Failure(ExitCode::kUsage, "runner submit: --instruction-set: expected " +
                                        record.instruction_set + ", with which the sweep in " +
                                        folder + " began, found " + instruction_set +
                                        ". Use another --folder");
  }
  // Before the databases are read: what ends meanwhile is finished, not missing.
  const Queue queue = AskedQueue(record);
  const Choice choice = Choose(specs, queue, &record);
  const BatchPlace place = Place(record);
  if (!print) {
    WriteConfigurations(choice.submitted, catalogue);
    WriteWholeFile(std::filesystem::path(folder) / kKnownPluginsFile,
                   results::JsonText(results::FieldsToJson(catalogue.described())) + "\n");
    WriteSubmission(folder, record);
  }
  std::vector<std::string> jobs = SubmitArrays(place, choice.submitted, &record);
  const bool unmerged = !std::filesystem::exists(std::filesystem::path(folder) / "report.html") &&
                        !queue.contains(record.merge_job);
  if (!choice.submitted.empty() || unmerged) {
    const std::string merge = SubmitMerge(place, queue, jobs, &record);
    if (!merge.empty()) jobs.push_back(merge);
  }
  for (const std::string& job : jobs) std::cout << job << "\n";

  std::cerr << Counted(specs.size(), "run") << ": " << choice.submitted.size()
            << (print ? " to submit, " : " submitted, ") << choice.finished << " finished, "
            << choice.active << " queued or active, " << choice.skipped << " skipped\n";
  if (print) {
    std::cerr << "nothing was written or submitted\n";
  } else {
    std::cerr << "next: " << ShellWord(place.runner.string()) << " status --folder "
              << ShellWord(folder) << "\n";
  }
  return choice.exit_status;
}

}  // namespace

Command SubmitCommand() { return MakeCommand<Submit>(); }

}  // namespace dreamsearch
