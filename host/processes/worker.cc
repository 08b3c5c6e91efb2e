#include "host/processes/worker.h"

#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <exception>
#include <iostream>

#include "dreamsearch/instruction_set.h"
#include "host/plugins/catalogue.h"
#include "host/processes/child_process.h"
#include "host/processes/crash_report.h"
#include "host/processes/eigen_product.h"
#include "host/processes/stop_signals.h"
#include "host/processes/thread_grant.h"
#include "host/processes/worker_end.h"
#include "host/processes/worker_report.h"
#include "host/training/build_and_host.h"
#include "host/training/evaluation.h"
#include "host/training/experiment.h"
#include "host/training/resumption.h"
#include "results/database/database.h"
#include "results/database/run_writer.h"
#include "results/system/error.h"
#include "results/system/file_descriptor.h"
#include "results/system/run_lock.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::atomic<bool> stop_requested{false};

// Of a worker in the process that started it: there is nobody to report to.
bool alone = false;

// To checkpoint and end, once the supervisor is gone.
std::atomic<std::uint32_t> grace_seconds{60};

// Stop at the next decision or update, however often it is asked: who signals a whole
// job reaches the worker directly and once more through the supervisor. The supervisor
// ends a worker at once with SIGKILL. One whose supervisor is gone ends itself once its time to
// checkpoint is over: it may hang in a plugin, and nobody else is left who would notice.
void RequestStop(int) {
  stop_requested = true;
  if (!alone && ParentIsGone()) ::alarm(grace_seconds);
}

// A signal that was ignored when `runner` was started stays ignored.
void CatchStopSignals() {
  struct sigaction action {};
  action.sa_handler = RequestStop;
  action.sa_flags = SA_RESTART;
  for (const int signal : kStopSignals) {
    if (!IsIgnored(signal)) ::sigaction(signal, &action, nullptr);
  }
  ::sigaction(StopRequestSignal(), &action, nullptr);
  ::signal(SIGALRM, SIG_DFL);
  ::signal(SIGPIPE, SIG_IGN);
}

void Send(const WorkerReport& report) {
  if (!alone) WriteAll(kReportDescriptor, EncodeWorkerReport(report));
}

// Tells the supervisor how the run gets on, also while it waits for the database.
class Reporter {
 public:
  explicit Reporter(std::string db) : db_(std::move(db)) {}

  void Show(const RunProgress& progress) {
    if (waiting_) {
      waiting_ = false;
      std::cerr << kOwnMark << "the database is unlocked\n";
    }
    if (progress.threads != report_.progress.threads) {
      std::cerr << kOwnMark << "threads: " << progress.threads << " from environment step "
                << progress.env_step << "\n";
    }
    report_.progress = progress;
    SendIfDue();
  }

  // Whether to go on waiting for another process to unlock the database: until a stop was asked
  // for, and for a moment after that.
  bool Wait(double seconds) {
    const double now = ActivityClock::Now();
    if (stop_requested) {
      if (stop_noticed_ == 0) stop_noticed_ = now;
      if (now - stop_noticed_ > kLastWaitSeconds) return false;
    }
    if (seconds < kSilentWaitSeconds) return true;
    if (!waiting_) {
      waiting_ = true;
      std::cerr << kOwnMark << "waiting: another process has locked the database " << db_ << "\n";
    }
    report_.progress.lock_wait_seconds = seconds;
    SendIfDue();
    return true;
  }

 private:
  static constexpr double kSilentWaitSeconds = 1;
  static constexpr double kLastWaitSeconds = 2;

  void SendIfDue() {
    const double now = ActivityClock::Now();
    if (now - last_sent_ < 0.2) return;
    last_sent_ = now;
    Send(report_);
  }

  std::string db_;
  WorkerReport report_;
  bool waiting_ = false;
  double last_sent_ = 0;
  double stop_noticed_ = 0;
};

// What a checkpoint must agree with before a run goes on from it.
void CheckHeader(const Checkpoint& checkpoint, const WorkerJob& job) {
  const auto stored = checkpoint.Value<CheckpointHeader>(kHeaderPart);
  const CheckpointHeader expected = HeaderOf(job.spec, stored.run);
  const std::string path = checkpoint.path().string();
  const auto check = [&](const char* what, const std::string& found, const std::string& wanted) {
    if (found == wanted) return;
    throw Failure(ExitCode::kPluginRefused,
                  path + " was made with another " + what + ": it has " + found + ", this run " +
                      wanted + ". Use the old one, another --study, or --replace to start over");
  };
  check("configuration", stored.configuration, expected.configuration);
  check("seed", std::to_string(stored.seed), std::to_string(expected.seed));
  if (const std::string changed = ChangedSince(job.spec, stored.plugins); !changed.empty()) {
    throw Failure(ExitCode::kPluginRefused,
                  path + " was made before something changed: " + changed +
                      ". Use the old one, another --study, or --replace to start over");
  }
  if (stored.instruction_set != expected.instruction_set && !job.force) {
    InstructionSet set{};
    const bool present =
        ParseInstructionSet(stored.instruction_set.c_str(), &set) && set <= BestInstructionSet();
    // The machine's fault: the run stays one that can be resumed.
    throw Failure(ExitCode::kInputOutput,
                  path + " was made with the instruction set " + stored.instruction_set +
                      ", this process has " + expected.instruction_set +
                      "; the bits would differ. Give the same command " +
                      (present ? "with " + std::string(kInstructionSetVariable) + "=" +
                                     stored.instruction_set + " before it"
                               : "on the old kind of machine") +
                      ", or accept that with `runner resume " + std::to_string(job.run_id) +
                      " --force --db " + ShellWord(job.db) + "`");
  }
}

std::unique_ptr<RunLoop> MakeRunLoop(const WorkerJob& job, const std::string& uuid,
                                     double segment_started, double gflop_per_second,
                                     const ThreadGrant& grant, results::RunWriter* writer) {
  if (job.spec.evaluation) {
    Evaluation::Options options;
    options.threads = job.evaluation_threads;
    options.agent = job.agent_checkpoint;
    options.header = HeaderOf(job.spec, uuid);
    return std::make_unique<Evaluation>(job.spec, options, writer, job.folder);
  }
  Experiment::Options options;
  options.segment_started = segment_started;
  options.gflop_per_second = gflop_per_second;
  options.threads = &grant.threads();
  options.log_decisions = job.log_decisions;
  options.record_trees = job.record_trees;
  options.keep_replay = job.keep_replay;
  options.retries = job.retries;
  options.header = HeaderOf(job.spec, uuid);
  return std::make_unique<Experiment>(job.spec, options, writer, job.folder);
}

int Work(const WorkerJob& job, const ThreadGrant& grant) {
  if (job.nice != 0 && ::setpriority(PRIO_PROCESS, 0, ::getpriority(PRIO_PROCESS, 0) + job.nice)) {
    std::cerr << kOwnMark << "warning: the priority of this process cannot be lowered\n";
  }
  const FileDescriptor lock = LockRun(job.folder);
  if (const std::string changed = ChangedFile(job.spec); !changed.empty()) {
    throw Failure(ExitCode::kPluginRefused, changed + " since it was described");
  }
  const auto database = results::Database::OpenExisting(job.db);
  Reporter reporter(job.db);
  database->connection().WaitForLocks([&](double seconds) { return reporter.Wait(seconds); });
  const std::optional<results::RunInfo> run = database->GetRun(job.run_id);
  if (!run) {
    throw Failure(ExitCode::kNotFound, job.db + ": there is no run " + std::to_string(job.run_id));
  }
  // Two who start at the same moment wait for the lock one after the other.
  if (run->last_segment != job.after_segment) {
    throw Failure(ExitCode::kInputOutput, "another process has resumed this run: segment " +
                                              std::to_string(job.after_segment) +
                                              " was its last one, now it is " +
                                              std::to_string(run->last_segment));
  }
  auto [loaded, point] =
      FindResumption(database.get(), *run, job.spec, job.folder, CheckpointFolder::Extent::kWhole);
  if (loaded) CheckHeader(loaded->checkpoint, job);

  results::RunWriter writer(database.get(), job.run_id);
  results::SegmentInfo segment;
  segment.pid = ::getpid();
  segment.host_id = database->Host(ThisHost());
  segment.build_id = database->Build(ThisBuild());
  segment.instruction_set = InstructionSetInUse();
  AddSlurmJob(&segment);
  segment.gflop_per_second = MeasureGflopPerSecond();
  writer.BeginSegment(segment, point);

  if (!loaded && !job.spec.environment.ingredients.empty()) {
    writer.AddEvent(0, "info", "ingredients",
                    results::JsonText(nlohmann::json(job.spec.environment.ingredients)));
  }
  if (job.retried) {
    const Retry& retry = job.retries.back();
    const bool within = retry.env_step != Retry().env_step;
    const std::string from =
        within ? "decisions from environment step " + std::to_string(retry.env_step)
               : "training episodes from " + std::to_string(retry.episode);
    writer.AddEvent(point.env_step, "info", "retry",
                    "retry " + std::to_string(retry.number) + ": " + from + " on have other seeds");
  }

  const double segment_started = ActivityClock::Now();
  std::unique_ptr<RunLoop> loop;
  bool ready = false;  // until then the run stands where the segment begins
  try {
    loop = MakeRunLoop(job, run->uuid, segment_started, segment.gflop_per_second, grant, &writer);
    if (loaded) {
      for (const CheckpointFolder::Skipped& skipped : loaded->skipped) {
        writer.AddEvent(point.env_step, "warning",
                        skipped.damaged ? "damaged_checkpoint" : "unused_checkpoint", skipped.why);
        std::cerr << kOwnMark << "warning: " << skipped.why << "\n";
      }
      loop->Load(loaded->checkpoint);
      writer.AddEvent(static_cast<std::int64_t>(loop->env_step()), "info", "resume",
                      "from " + loaded->checkpoint.path().filename().string());
      std::cerr << kOwnMark << "resumed at environment step " << loop->env_step() << "\n";
      loaded.reset();
    }
    ready = true;
    const RunLoop::Outcome outcome =
        loop->Run(&stop_requested, [&](const RunProgress& progress) { reporter.Show(progress); });
    const auto env_step = static_cast<std::int64_t>(loop->env_step());
    if (outcome == RunLoop::Outcome::kInterrupted) {
      writer.EndSegment("interrupted", env_step);
      std::cerr << kOwnMark << "interrupted at environment step " << env_step
                << ", checkpoint written\n";
      return static_cast<int>(ExitCode::kInterrupted);
    }
    WorkerReport report;
    report.kind = WorkerReport::Kind::kDone;
    report.result_digest = writer.Finish();
    Send(report);
    std::cerr << kOwnMark << "finished, result digest " << report.result_digest << "\n";
    return 0;
  } catch (const Failure& error) {
    const std::int64_t env_step =
        ready ? static_cast<std::int64_t>(loop->env_step()) : point.env_step;
    const results::RunStatus status = StatusOf(error.code());
    const char* reason = results::RunStatusName(status);
    try {
      // What the machine did to it, its supervisor records.
      if (status != results::RunStatus::kInterrupted) {
        writer.AddEvent(env_step, "error", reason, error.what());
      }
      writer.EndSegment(reason, env_step);
    } catch (const Failure& second) {
      std::cerr << kOwnMark << "warning: the end of this segment is not recorded: " << second.what()
                << "\n";
    }
    throw;
  }
}

}  // namespace

std::string EncodeJob(const WorkerJob& job) {
  return results::JsonText(results::FieldsToJson(job));
}

WorkerJob DecodeJob(const std::string& text) {
  try {
    return results::FieldsFromJson<WorkerJob>(results::ParseJson(text));
  } catch (const nlohmann::json::exception& error) {
    throw Failure(ExitCode::kInternal,
                  std::string("a worker is started by `runner` and takes its job on standard "
                              "input: ") +
                      error.what());
  }
}

int WorkerMain() {
  // Die politely if the supervisor dies.
  CatchStopSignals();
  EndWithParent(StopRequestSignal());
  ReportCrashes();
  const auto fail = [](int status, const std::string& message) {
    std::cerr << "error: " << message << "\n";
    WorkerReport report;
    report.kind = WorkerReport::Kind::kError;
    report.message = message;
    Send(report);
    return status;
  };
  try {
    const WorkerJob job = DecodeJob(ReadAll(0));
    grace_seconds = job.grace_seconds;
    if (stop_requested) RequestStop(0);
    return Work(job, ThreadGrant(kThreadsDescriptor));
  } catch (const Failure& error) {
    return fail(error.exit_status(), error.what());
  } catch (const std::bad_alloc&) {
    return fail(static_cast<int>(ExitCode::kInternal),
                "out of memory; lower run.replay_capacity or --jobs");
  }
}

int WorkHere(const WorkerJob& job, std::string* error) {
  alone = true;
  stop_requested = false;
  CatchStopSignals();
  try {
    const ThreadGrant one;
    return Work(job, one);
  } catch (const Failure& failure) {
    *error = failure.what();
    return failure.exit_status();
  } catch (const std::bad_alloc&) {
    *error = "out of memory; lower run.replay_capacity";
    return static_cast<int>(ExitCode::kInternal);
  }
}

}  // namespace dreamsearch
