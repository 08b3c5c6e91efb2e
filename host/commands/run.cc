// runner --env NAMES --planner NAMES - how good do agents become that are trained like this?
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <set>
#include <thread>

#include "host/commands/commands.h"
#include "host/commands/progress.h"
#include "host/flags/flags.h"
#include "host/flags/run_flags.h"
#include "host/plugins/catalogue.h"
#include "host/processes/supervisor.h"
#include "host/settings/memory.h"
#include "host/settings/settings.h"
#include "host/sweeps/probe.h"
#include "host/sweeps/sweep.h"
#include "host/sweeps/working_database.h"
#include "results/system/error.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

const char* SweepActionText(SweepAction action) {
  switch (action) {
    case SweepAction::kStart:
      return "start";
    case SweepAction::kResume:
      return "resume";
    case SweepAction::kStartOver:
      return "start over";
    case SweepAction::kSkipFinished:
      return "skip, finished";
    case SweepAction::kSkipFailed:
      return "skip, failed";
    case SweepAction::kSkipActive:
      return "skip, active";
    case SweepAction::kRefused:
      return "refuse";
  }
  return "";
}

void SayNotice(const std::string& notice) { std::cerr << "note: " << notice << "\n"; }

// Measures each configuration once, and takes what its environment is made of.
std::vector<ProbeResult> MeasureAll(std::vector<RunSpec>* specs, const ProcessOptions& options) {
  std::map<std::string, ProbeResult> known;
  std::set<std::string> said;
  std::vector<ProbeResult> results;
  for (RunSpec& spec : *specs) {
    const std::string key = CanonicalJson(spec);
    auto found = known.find(key);
    if (found == known.end()) {
      std::cerr << "measuring " << spec.environment.task() << ", " << spec.planner.name() << " ..."
                << std::endl;
      found = known.emplace(key, ProbeRun(spec, ProbeDepth::kCosts, options)).first;
      const std::string& notice = found->second.notice;
      if (!notice.empty() && said.insert(notice).second) SayNotice(notice);
    }
    spec.environment.ingredients = found->second.ingredients;
    results.push_back(found->second);
  }
  return results;
}

// "mcts_pw.simulations = 6  (command line)" for every resolved setting of a run.
std::vector<std::string> SettingLines(const RunSpec& spec) {
  std::vector<std::string> lines;
  const auto add = [&](const std::string& prefix, const ResolvedValues& values) {
    for (const ResolvedValue& value : values.values) {
      std::string line = prefix + "." + value.name + " = " + ValueText(value);
      if (value.origin != ValueOrigin::kDefault) {
        line += std::string("  (") + ValueOriginName(value.origin) + ")";
      }
      lines.push_back(std::move(line));
    }
  };
  add("run", spec.run);
  add(spec.environment.task(), spec.environment.parameters);
  add("model " + spec.model.name(), spec.model.parameters);
  add(spec.planner.name(), spec.planner.parameters);
  if (spec.eval_planner.name() != spec.planner.name()) {
    add(spec.eval_planner.name(), spec.eval_planner.parameters);
  }
  return lines;
}

// Every setting once: first what all configurations have, then under the tasks,
// models and planners that have it what is left.
void PrintSettings(const std::vector<PlannedRun>& runs) {
  std::set<std::string> seen;
  std::vector<const RunSpec*> configurations;
  for (const PlannedRun& run : runs) {
    if (seen.insert(CanonicalJson(run.spec)).second) configurations.push_back(&run.spec);
  }
  std::vector<std::string> order;
  std::map<std::string, std::size_t> counts;
  for (const RunSpec* spec : configurations) {
    for (const std::string& line : SettingLines(*spec)) {
      if (counts[line]++ == 0) order.push_back(line);
    }
  }
  const bool one = configurations.size() == 1;
  std::cout << "\nsettings" << (one ? "" : " of all") << " (preset "
            << configurations.front()->preset << ")\n";
  const auto print = [&](bool common) {
    for (const std::string& line : order) {
      if ((counts[line] == configurations.size()) == common) std::cout << "  " << line << "\n";
    }
  };
  print(true);
  if (std::all_of(order.begin(), order.end(),
                  [&](const auto& line) { return counts[line] == configurations.size(); })) {
    return;
  }
  std::cout << "\nsettings of the tasks, models and planners that they name\n";
  print(false);
}

// How long a run that is stopped takes for its checkpoint, and how long it may.
void SayStopping(const ProcessOptions& options, double bytes, double saving) {
  const std::filesystem::path& place = options.scratch.empty() ? options.db : options.scratch / "x";
  const double seconds = saving + SecondsToWrite(bytes, place);
  const double grace = GraceSeconds(options);
  std::cout << "stopping: a run's last checkpoint, " << FormatBytes(bytes) << ", takes about "
            << FormatNumber("%.1f s", seconds) << "; it has " << FormatDuration(grace)
            << " for it and is then killed\n";
  if (seconds > grace) {
    std::cout << "warning: a run that is stopped late loses what it did since its last regular "
                 "checkpoint, of "
              << "run.checkpoint_every; lower run.replay_capacity"
              << (grace < 60 ? ", or raise --hang-timeout" : "") << "\n";
  }
}

int DryRun(const RunOptions& options, const std::vector<PlannedRun>& runs,
           const std::vector<ProbeResult>& probes) {
  std::cout << "runs\n";
  double seconds = 0, bytes = 0, longest = 0, memory = 0, checkpoint = 0, saving = 0;
  std::size_t work = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const PlannedRun& run = runs[i];
    std::cout << "  " << RunLabel(run.spec) << ": " << SweepActionText(run.action);
    if (IsWork(run.action)) {
      const RunEstimate estimate = EstimateRun(run.spec, probes[i]);
      ++work;
      seconds += estimate.seconds;
      longest = std::max(longest, estimate.seconds);
      bytes += estimate.database_bytes + estimate.file_bytes;
      memory = std::max(memory, estimate.memory_bytes);
      checkpoint = std::max(checkpoint, estimate.checkpoint_bytes);
      saving = std::max(saving, probes[i].costs.model_save);
      std::cout << ", " << GroupDigits(run.spec.steps()) << " environment steps, about "
                << FormatDuration(estimate.seconds) << " on one core, "
                << FormatBytes(estimate.database_bytes) << " of rows, "
                << FormatBytes(estimate.file_bytes) << " of checkpoints, "
                << FormatBytes(estimate.memory_bytes) << " of memory";
    }
    if (!run.note.empty()) std::cout << " (" << run.note << ")";
    std::cout << "\n";
  }
  PrintSettings(runs);
  const WorkLimits limits = LimitsOf(options.process, static_cast<std::uint64_t>(memory));
  const auto jobs = static_cast<double>(
      std::max<std::size_t>(1, std::min<std::size_t>(work, static_cast<std::size_t>(limits.jobs))));
  std::cout << "\ntotal: " << work << " of " << Counted(runs.size(), "run") << " to work on, about "
            << FormatDuration(std::max(longest, seconds / jobs)) << " with --jobs " << limits.jobs
            << ", at most " << FormatBytes(bytes) << " in "
            << std::filesystem::absolute(options.process.db).lexically_normal().string() << "\n";
  if (limits.memory_bytes > 0) {
    const auto limit = static_cast<double>(limits.memory_bytes);
    std::cout << "memory: a run takes about " << FormatBytes(memory) << " and may take "
              << FormatBytes(limit) << "\n";
    if (memory > limit) {
      std::cout << "warning: that is too little; give more with --memory-limit or fewer --jobs, or "
                   "lower run.replay_capacity\n";
    }
  }
  if (work > 0) SayStopping(options.process, checkpoint, saving);
  std::cout << "times were measured here just now; nothing was run or written\n";
  return SweepStatus(runs, {});
}

// Of a budget that ends before learning begins; all runs of a command have the same.
void WarnOfNoLearning(const std::vector<RunSpec>& specs) {
  const std::uint64_t prefill = specs.front().run.Integer("prefill_steps");
  const std::uint64_t steps = specs.front().steps();
  if (steps > prefill) return;
  std::cerr << "warning: --steps " << steps << " is not more than run.prefill_steps = " << prefill
            << ", so every action of the training is random and "
            << (steps < prefill ? "nothing is learned" : "nothing that is learned is tried")
            << "; give more --steps, or a smaller number with --set run.prefill_steps=N\n";
}

// How a shell calls another program of this installation from the current folder.
std::string ProgramPath(const char* name) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path path = self.parent_path() / name;
  const std::filesystem::path relative = std::filesystem::relative(path, error);
  if (error || relative.empty() || relative.string().size() > path.string().size()) {
    return ShellWord(path.string());
  }
  return ShellWord((relative.has_parent_path() ? "" : "./") + relative.string());
}

struct Train {
  RunOptions options;

  CommandSpec Declare() { return RunFlags(&options); }
  int Run(const Words& words);
};

int Train::Run(const Words& words) {
  const Catalogue catalogue = ScanPlugins(options.process.plugin_path);
  std::vector<RunSpec> specs = ResolveMatrix(options, catalogue);
  WarnOfNoLearning(specs);
  const bool exists = std::filesystem::exists(options.process.db);

  if (options.process.dry_run) {
    results::Database::CheckWritable(options.process.db.string());
    const auto database =
        exists ? results::Database::OpenReadOnly(options.process.db.string()) : nullptr;
    const std::vector<ProbeResult> probes = MeasureAll(&specs, options.process);
    return DryRun(options, PlanSweep(database.get(), options.process, specs), probes);
  }

  const SweepFigures figures = ProbeSweep(&specs, options.process);
  for (const std::string& notice : figures.notices) SayNotice(notice);
  ProgressDisplay progress;
  WorkingDatabase working(options.process, /*exists=*/false, &progress);
  auto database = results::Database::OpenOrCreate(working.path());
  for (const std::string& warning : database->warnings()) {
    std::cerr << "warning: " << warning << "\n";
  }
  const std::vector<PlannedRun> planned = PlanSweep(database.get(), options.process, specs);
  std::map<SweepAction, int> counts;
  const int failed_before = SaySkipped(database.get(), planned);
  for (const PlannedRun& run : planned) ++counts[run.action];
  std::cerr << Counted(planned.size(), "run") << ":";
  for (const auto& [action, count] : counts) {
    std::cerr << " " << count << " to " << SweepActionText(action)
              << (action == counts.rbegin()->first ? "" : ",");
  }
  std::cerr << "; database " << working.Name() << std::endl;

  std::vector<std::string> argv = {"runner"};
  argv.insert(argv.end(), words.begin(), words.end());
  std::vector<SweepJob> jobs =
      RecordSweep(database.get(), options.process, planned, figures.tasks, argv);
  for (SweepJob& job : jobs) job.memory_bytes = figures.memory_bytes;
  const std::size_t work = jobs.size();
  const SweepResult result =
      RunSweep(database.get(), options.process, std::move(jobs), working.observer());

  const int exit_status = SweepStatus(planned, result);
  database.reset();
  working.Finish();

  std::map<results::RunStatus, int> ended;
  for (const results::RunStatus status : result.statuses) ++ended[status];
  if (work > 0) {
    std::cerr << "of " << Counted(work, "run") << ":";
    for (const auto& [status, count] : ended) {
      std::cerr << " " << count << " " << results::RunStatusName(status);
    }
    std::cerr << std::endl;
  }
  if (failed_before != 0) {
    std::cerr << Counted(static_cast<std::uint64_t>(counts[SweepAction::kSkipFailed]), "run")
              << " failed before; repeat the command with "
              << (std::any_of(planned.begin(), planned.end(),
                              [](const PlannedRun& run) { return run.changed; })
                      ? "--replace to start them over"
                      : "--retry to try again")
              << std::endl;
  }
  const std::string db = ShellWord(options.process.db.string());
  if (ended[results::RunStatus::kInterrupted] > 0 ||
      result.exit_status == static_cast<int>(ExitCode::kInterrupted)) {
    std::cerr << "resume with the same command, or with: " << ProgramPath("runner")
              << " resume --db " << db << "\n";
  } else {
    std::cerr << "next: " << ProgramPath("results") << " list --db " << db << "\n";
    // Runs of before may be there to draw.
    if (work == 0 || ended[results::RunStatus::kFinished] > 0) {
      std::cerr << "      " << ProgramPath("results") << " curves --db " << db
                << " --out curves.svg\n";
    }
    if (std::any_of(result.statuses.begin(), result.statuses.end(), results::HasFailed)) {
      std::cerr << "      the same command with --retry, to try again what failed\n";
    }
  }
  return exit_status != 0 ? exit_status : failed_before;
}

}  // namespace

Command RunCommand() { return MakeCommand<Train>(); }

}  // namespace dreamsearch
