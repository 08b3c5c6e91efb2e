// supervisor.cc - the loop of a sweep. Over 400 lines: one class, whose parts (starting, sharing
// cores, watching, recording) all work on the one table of active runs.
#include "host/processes/supervisor.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <deque>
#include <exception>
#include <iterator>
#include <limits>
#include <map>
#include <memory>

#include "host/acting/activity_clock.h"
#include "host/processes/child_process.h"
#include "host/processes/stop_signals.h"
#include "host/processes/thread_grant.h"
#include "host/processes/worker_end.h"
#include "host/processes/worker_report.h"
#include "host/settings/cores.h"
#include "host/settings/memory.h"
#include "host/training/rate_meter.h"
#include "results/system/file.h"
#include "results/system/file_descriptor.h"
#include "results/system/run_lock.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr double kGraceSeconds = 60;

// How often it is tried again to record what could not be.
constexpr double kRecordAgainSeconds = 1;

// How long it waits for another process to unlock the database: with runs to watch, and
// without.
constexpr double kRecordPatienceSeconds = 1;
constexpr double kLockPatienceSeconds = 30;

// After so many times --hang-timeout of wall time without a report and without work a worker hangs,
// in a lock or asleep; and how long it then has to say where.
constexpr double kIdleFactor = 10;
constexpr double kReportSeconds = 2;

// How soon a run takes a core that another command's run has left, or gives it back.
constexpr double kShareAgainSeconds = 0.25;

std::atomic<int> stop_signals{0};

// Whether the process belongs to a job of Slurm, which has its own way of ending it at once.
std::atomic<bool> in_slurm{false};

// The system repeats SIGXCPU every second. In a job of Slurm a signal may come twice: to the batch
// script, which forwards it, and to all processes.
void CountStopSignal(int signal) {
  const bool impatient = signal == SIGINT || (signal != SIGXCPU && !in_slurm);
  if (impatient || stop_signals == 0) ++stop_signals;
}

// Counts stop signals while it lives, except those that were ignored before.
class StopSignals {
 public:
  StopSignals() {
    stop_signals = 0;
    in_slurm = std::getenv("SLURM_JOB_ID") != nullptr;
    struct sigaction action {};
    action.sa_handler = CountStopSignal;
    for (std::size_t i = 0; i < kCount; ++i) {
      ::sigaction(kStopSignals[i], nullptr, &before_[i]);
      if (before_[i].sa_handler != SIG_IGN) ::sigaction(kStopSignals[i], &action, nullptr);
    }
  }
  ~StopSignals() {
    for (std::size_t i = 0; i < kCount; ++i) ::sigaction(kStopSignals[i], &before_[i], nullptr);
  }
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  static constexpr std::size_t kCount = std::size(kStopSignals);
  struct sigaction before_[kCount];
};

struct ActiveRun {
  std::size_t index = 0;
  pid_t pid = -1;
  std::int64_t after_segment = -1;  // the run's last one when it was started
  FileDescriptor reports;
  std::unique_ptr<ThreadGrant> grant;
  std::vector<std::size_t> places;  // among the runs that share the cores
  std::string unread;
  double started = 0;
  double processor_at_report = 0;
  double alive_at = 0;  // it reported, worked, waited for a disk or was stopped
  double processor_when_alive = 0;
  RateMeter rate;
  ActiveLine line;
  WorkerCourse course;
  double asked_at = 0;  // to end
  double hang_at = 0;   // told to say where it hangs
};

// What became of a run.
struct Ending {
  std::size_t index = 0;
  results::WorkerInfo worker;
  results::RunStatus status = results::RunStatus::kFailed;
  int exit_code = 0;
  std::string error;
  std::int64_t env_step = 0;  // of training, as far as reports told
};

std::uint64_t LargestOf(const std::vector<SweepJob>& jobs) {
  std::uint64_t most = 0;
  for (const SweepJob& job : jobs) most = std::max(most, job.memory_bytes);
  return most;
}

class Sweep {
 public:
  Sweep(results::Database* database, const ProcessOptions& options, std::vector<SweepJob> jobs,
        SweepObserver* observer)
      : database_(database),
        options_(options),
        jobs_(std::move(jobs)),
        limits_(LimitsOf(options, LargestOf(jobs_))),
        observer_(observer) {
    result_.statuses.assign(jobs_.size(), results::RunStatus::kQueued);
    exit_codes_.assign(jobs_.size(), 0);
    for (const SweepJob& job : jobs_) {
      const std::optional<results::RunInfo> run = database_->GetRun(job.work.run_id);
      planned_after_.push_back(run ? run->last_segment : -1);
    }
    // Of an evaluation, whose times count, --jobs is the number of threads, the same to its end.
    const std::size_t at_once =
        std::max<std::size_t>(1, std::min(jobs_.size(), static_cast<std::size_t>(limits_.jobs)));
    for (SweepJob& job : jobs_) {
      if (!job.work.spec.evaluation) continue;
      job.work.evaluation_threads = static_cast<std::uint32_t>(
          std::clamp<std::size_t>(static_cast<std::size_t>(limits_.jobs) / at_once, 1,
                                  job.work.spec.run.Integer("eval_episodes")));
    }
  }

  ~Sweep() {
    database_->connection().WaitForLocks(
        [](double seconds) { return seconds < kLockPatienceSeconds; });
  }
  Sweep(const Sweep&) = delete;
  Sweep& operator=(const Sweep&) = delete;

  SweepResult Run() {
    const StopSignals signals;
    database_->connection().WaitForLocks([this](double seconds) {
      if (seconds > kRecordPatienceSeconds && !said_locked_) {
        said_locked_ = true;
        observer_->Say("waiting: another process has locked " + database_->path());
      }
      return seconds <
             (stop_signals > 0 ? std::min(lock_patience_, kRecordPatienceSeconds) : lock_patience_);
    });
    return RunJobs();
  }

 private:
  SweepResult RunJobs() {
    started_ = ActivityClock::Now();
    while (next_ < jobs_.size() || !active_.empty()) {
      if (stop_signals > 0 && !stopping_) {
        stopping_ = true;
        if (!active_.empty()) {
          observer_->Say("stopping: waiting for checkpoints (again to stop at once)");
        }
        for (const auto& [index, run] : active_) Ask(run.get(), WorkerCourse::Asked::kStop);
      } else if (stop_signals > 1 && !stopped_at_once_) {
        stopped_at_once_ = true;
        for (const auto& [index, run] : active_) Kill(run.get(), WorkerCourse::Killed::kStop);
      }
      if (stopping_ && active_.empty()) break;
      while (!stopping_ && next_ < jobs_.size() &&
             active_.size() < static_cast<std::size_t>(limits_.jobs)) {
        Start(next_++);
      }
      ShareCores();
      Wait();
      WatchLimits();
      Reap();
      if (ActivityClock::Now() - tried_to_record_ > kRecordAgainSeconds) {
        RecordAgain(kRecordPatienceSeconds);
      }
      ShowProgress();
    }
    RecordAgain(stopping_ ? kRecordPatienceSeconds : std::numeric_limits<double>::infinity());
    for (const Ending& ending : unrecorded_) {
      observer_->Say("could not be recorded in " + database_->path() + ": " + Describe(ending));
    }
    if (stopping_) {
      result_.exit_status = static_cast<int>(ExitCode::kInterrupted);
    } else if (!unrecorded_.empty()) {
      result_.exit_status = static_cast<int>(ExitCode::kInputOutput);
    } else {
      const auto bad =
          std::find_if(exit_codes_.begin(), exit_codes_.end(), [](int code) { return code != 0; });
      result_.exit_status = bad == exit_codes_.end() ? 0 : *bad;
    }
    return std::move(result_);
  }

  // An error of the database costs the run that met it its turn, never the others.
  void Start(std::size_t index) {
    try {
      StartUnlessTaken(index);
    } catch (const Failure& error) {
      exit_codes_[index] = error.exit_status();
      ++ended_;
      observer_->Say("not started " + jobs_[index].label + ": " + error.what());
    }
  }

  void StartUnlessTaken(std::size_t index) {
    const SweepJob& job = jobs_[index];
    // Another runner on this database may have come first since the sweep was planned.
    const std::optional<results::RunInfo> known = database_->GetRun(job.work.run_id);
    if (!known) {
      Skip(index, "it was deleted");
      return;
    }
    // Its worker may have finished it while its supervisor has yet to say so.
    const bool resumed_since = known->last_segment != planned_after_[index];
    if (known->status == results::RunStatus::kFinished ||
        (resumed_since && !known->result_digest.empty())) {
      Skip(index, "another process has finished it");
      return;
    }
    // Its failure is not tried again unasked, and not a second time if asked.
    if (results::HasFailed(known->status) && (!options_.retry || resumed_since)) {
      exit_codes_[index] = FailureCode(*known);
      Skip(index, std::string(results::RunStatusName(known->status)) + " in another process (" +
                      known->error + ")");
      return;
    }
    if (RunIsLocked(job.work.folder)) {
      Skip(index, "another process is working on it");
      return;
    }
    auto run = std::make_unique<ActiveRun>();
    run->index = index;
    run->after_segment = known->last_segment;
    try {
      std::error_code error;
      std::filesystem::create_directories(job.work.folder, error);
      CheckIsNoLink(job.work.folder);
      const std::filesystem::path log_path = job.work.folder / "run.log";
      const FileDescriptor log(
          ::open(log_path.c_str(),
                 O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0644));
      if (log.get() < 0) {
        const int reason = errno;
        throw Failure(reason == EACCES || reason == EROFS ? ExitCode::kPermission
                      : reason == ENOENT || reason == ENOTDIR || reason == ELOOP
                          ? ExitCode::kCannotCreate
                          : ExitCode::kInputOutput,
                      "cannot create " + log_path.string() + ": " + std::strerror(reason));
      }
      run->course.log_begin = ::lseek(log.get(), 0, SEEK_END);
      Pipe pipe = MakePipe();
      WorkerJob work = job.work;
      work.after_segment = known->last_segment;
      work.grace_seconds = static_cast<std::uint32_t>(std::ceil(GraceSeconds(options_)));
      if (options_.in_process) {
        WorkInThisProcess(run.get(), work);
        return;
      }
      const FileDescriptor input = MemoryFile(EncodeJob(work));
      run->grant = std::make_unique<ThreadGrant>();
      const FileDescriptor threads = run->grant->TakeDescriptor();
      ChildSpec child;
      child.arguments = {"worker"};
      child.input = input.get();
      child.log = log.get();
      child.report = pipe.write.get();
      child.threads = threads.get();
      run->pid = StartChild(child);
      run->reports = std::move(pipe.read);
    } catch (const Failure& error) {
      SetStatus(*run, StatusOf(error.code()), error.exit_status(), error.what());
      return;
    } catch (const std::exception& error) {
      SetStatus(*run, results::RunStatus::kFailed, static_cast<int>(ExitCode::kInternal),
                std::string("cannot be started: ") + error.what());
      return;
    }
    for (std::uint32_t i = 0; i < job.work.evaluation_threads; ++i) {
      run->places.push_back(sharing_.Enter());
    }
    shared_ = false;
    run->started = run->alive_at = ActivityClock::Now();
    run->line.label = job.label;
    run->line.env_steps_target = job.work.spec.work_steps();
    // A training's rate must hold an episode with its updates; decisions are all alike.
    run->rate = RateMeter(job.work.spec.evaluation ? 1 : 1000);
    observer_->Say("started " + job.label);
    active_[index] = std::move(run);
  }

  // Without a child: a crash ends this process, and the same command resumes the run.
  void WorkInThisProcess(ActiveRun* run, const WorkerJob& work) {
    observer_->Say("working in this process on " + jobs_[run->index].label);
    run->pid = ::getpid();
    const int code = WorkHere(work, &run->course.error);
    run->course.done = code == 0;
    stopping_ = stopping_ || code == static_cast<int>(ExitCode::kInterrupted);
    constexpr int kExitShift = 8;  // as waitpid tells an exit status
    Finish(run, code << kExitShift);
  }

  // Gives the runs the cores that no run of ours or of another command needs.
  void ShareCores() {
    const double now = ActivityClock::Now();
    if (shared_ && now - shared_at_ < kShareAgainSeconds) return;
    const std::map<std::size_t, std::uint32_t> threads = sharing_.Threads();
    for (const auto& [index, run] : active_) {
      const WorkerJob& work = jobs_[index].work;
      run->line.threads =
          work.spec.evaluation ? work.evaluation_threads : threads.at(run->places.front());
      run->grant->Set(run->line.threads);
    }
    shared_ = true;
    shared_at_ = now;
  }

  // Sleeps until a report arrives, a child ends or a moment has passed.
  void Wait() {
    std::vector<pollfd> polled;
    for (const auto& [index, run] : active_) {
      if (run->reports.get() >= 0) polled.push_back({run->reports.get(), POLLIN, 0});
    }
    ::poll(polled.data(), polled.size(), 100);
    for (const auto& [index, run] : active_) Read(run.get());
  }

  void Read(ActiveRun* run) {
    if (run->reports.get() < 0) return;
    char buffer[4096];
    for (;;) {
      const ssize_t got = ::read(run->reports.get(), buffer, sizeof buffer);
      if (got > 0) {
        run->unread.append(buffer, static_cast<std::size_t>(got));
      } else {
        if (got == 0) run->reports.Close();
        break;
      }
    }
    std::size_t begin = 0;
    for (std::size_t end; (end = run->unread.find('\n', begin)) != std::string::npos;
         begin = end + 1) {
      if (const auto report = DecodeWorkerReport(run->unread.substr(begin, end - begin))) {
        Take(run, *report);
      }
    }
    run->unread.erase(0, begin);
    // A plugin that writes without end to our descriptor must not fill memory.
    if (run->unread.size() > 1 << 20) run->unread.clear();
  }

  void Take(ActiveRun* run, const WorkerReport& report) {
    switch (report.kind) {
      case WorkerReport::Kind::kProgress:
        run->processor_at_report = ProcessorSeconds(run->pid);
        run->alive_at = ActivityClock::Now();
        if (report.progress.lock_wait_seconds > 0 && run->line.progress.lock_wait_seconds == 0) {
          observer_->Say("waiting " + run->line.label + ": another process has locked " +
                         database_->path());
        }
        run->line.progress = report.progress;
        run->rate.Add(
            ActivityClock::Now(), report.progress.env_step,
            report.progress.stage != RunStage::kExploring && report.progress.env_step > 0);
        run->line.rate = run->rate.Rate();
        break;
      case WorkerReport::Kind::kError:
        run->course.error = report.message;
        break;
      case WorkerReport::Kind::kDone:
        run->course.done = true;
        break;
    }
  }

  // Processor time until progress is due: that of every decision under way.
  double Patience(const ActiveRun& run) const {
    return options_.hang_timeout_seconds *
           static_cast<double>(std::max<std::uint64_t>(run.line.progress.decisions, 1));
  }

  void WatchLimits() {
    const double now = ActivityClock::Now();
    for (const auto& [index, run] : active_) {
      const bool asked = run->course.asked != WorkerCourse::Asked::kNo;
      if (const std::uint64_t memory = limits_.memory_bytes == 0 ? 0 : ResidentBytes(run->pid);
          memory > limits_.memory_bytes) {
        run->course.memory_bytes = memory;
        Kill(run.get(), WorkerCourse::Killed::kMemory);
      }
      const bool watched = options_.hang_timeout_seconds > 0;
      const double processor = ProcessorSeconds(run->pid);
      if (processor > run->processor_when_alive || !IsAsleep(run->pid)) {
        run->processor_when_alive = processor;
        run->alive_at = now;
      }
      if (run->course.killed == WorkerCourse::Killed::kHang) {
        if (now - run->hang_at > kReportSeconds) ::kill(run->pid, SIGKILL);
      } else if (watched && processor - run->processor_at_report > Patience(*run)) {
        EndHang(run.get());
      } else if (watched && !asked && now - run->alive_at > kIdleFactor * Patience(*run)) {
        run->course.idle_seconds = now - run->alive_at;
        EndHang(run.get());
      } else if (asked && now - run->asked_at > GraceSeconds(options_)) {
        Kill(run.get(), WorkerCourse::Killed::kOverdue);
      } else if (!asked && options_.time_limit_seconds > 0 &&
                 now - run->started > options_.time_limit_seconds) {
        Ask(run.get(), WorkerCourse::Asked::kTimeLimit);
      }
    }
  }

  // It says where it hangs, in its log, and is killed if it does not end by that.
  void EndHang(ActiveRun* run) {
    if (run->course.killed != WorkerCourse::Killed::kNo) return;
    run->course.killed = WorkerCourse::Killed::kHang;
    run->hang_at = ActivityClock::Now();
    ::kill(run->pid, SIGABRT);
  }

  void Ask(ActiveRun* run, WorkerCourse::Asked why) {
    if (run->course.asked != WorkerCourse::Asked::kNo) return;
    run->course.asked = why;
    run->asked_at = ActivityClock::Now();
    ::kill(run->pid, StopRequestSignal());
    ::kill(run->pid, SIGCONT);  // a stopped worker must hear it
  }

  void Kill(ActiveRun* run, WorkerCourse::Killed why) {
    if (run->course.killed != WorkerCourse::Killed::kNo) return;
    run->course.killed = why;
    ::kill(run->pid, SIGKILL);
  }

  void Reap() {
    for (auto it = active_.begin(); it != active_.end();) {
      int status = 0;
      const pid_t ended = ::waitpid(it->second->pid, &status, WNOHANG);
      if (ended == it->second->pid) {
        Read(it->second.get());
        for (const std::size_t place : it->second->places) sharing_.Leave(place);
        shared_ = false;
        Finish(it->second.get(), status);
        it = active_.erase(it);
      } else {
        ++it;
      }
    }
  }

  void Finish(ActiveRun* run, int status) {
    WorkerCourse& course = run->course;
    course.stage = run->line.progress.stage;
    course.log = jobs_[run->index].work.folder / "run.log";
    course.patience_seconds = Patience(*run);
    course.grace_seconds = GraceSeconds(options_);
    course.time_limit_seconds = options_.time_limit_seconds;
    course.memory_limit_bytes = limits_.memory_bytes;
    course.memory_limit_given = options_.memory_limit_bytes != kShareOfMemory;
    const WorkerEnd end = EndOf(course, status);
    if (end.exit_code == static_cast<int>(ExitCode::kInputOutput) &&
        RunIsLocked(jobs_[run->index].work.folder)) {
      Skip(run->index, "another process began it at the same moment");
      return;
    }
    SetStatus(*run, end.status, end.exit_code, end.error);
  }

  // The run is another process's; its status is not ours to write.
  void Skip(std::size_t index, const std::string& why) {
    const SweepJob& job = jobs_[index];
    try {
      if (const auto known = database_->GetRun(job.work.run_id)) {
        result_.statuses[index] = known->status;
      }
    } catch (const Failure&) {  // the status is for the summary only
    }
    ++ended_;
    observer_->Say("skipped " + job.label + ": " + why);
  }

  void SetStatus(const ActiveRun& run, results::RunStatus status, int exit_code,
                 const std::string& error) {
    const SweepJob& job = jobs_[run.index];
    const Ending ending{.index = run.index,
                        .worker = {.pid = run.pid, .after_segment = run.after_segment},
                        .status = status,
                        .exit_code = exit_code,
                        .error = error,
                        .env_step = job.work.spec.evaluation
                                        ? 0
                                        : static_cast<std::int64_t>(run.line.progress.env_step)};
    try {
      lock_patience_ = kRecordPatienceSeconds;
      const bool recorded = Record(ending);
      lock_patience_ = kLockPatienceSeconds;
      if (!recorded) {
        Skip(run.index, "another process has resumed it or deleted it");
        return;
      }
    } catch (const Failure& problem) {
      lock_patience_ = kLockPatienceSeconds;
      unrecorded_.push_back(ending);
      observer_->Say("cannot record yet what became of " + job.label + ": " + problem.what());
    }
    result_.statuses[run.index] = status;
    exit_codes_[run.index] = exit_code;
    ++ended_;
    observer_->Say(Describe(ending));
  }

  std::string Describe(const Ending& ending) const {
    const std::string text =
        std::string(results::RunStatusName(ending.status)) + " " + jobs_[ending.index].label;
    return ending.error.empty() ? text : text + ": " + ending.error;
  }

  // False if another process has resumed the run or deleted it: its status is not ours.
  bool Record(const Ending& ending) {
    const std::int64_t run_id = jobs_[ending.index].work.run_id;
    bool recorded = false;
    database_->connection().Transact([&] {
      recorded = database_->SetRunStatus(run_id, ending.status, ending.exit_code, ending.error,
                                         ending.worker);
      // The worker has written what it could notice itself.
      const bool noticed = ending.status == results::RunStatus::kFailed ||
                           ending.status == results::RunStatus::kDiverged;
      if (!recorded || noticed || ending.error.empty()) return;
      database_->AddEvent(
          run_id, std::max(ending.env_step, database_->GetRun(run_id)->env_steps_done),
          ending.status != results::RunStatus::kInterrupted              ? "error"
          : ending.exit_code == static_cast<int>(ExitCode::kInterrupted) ? "info"
                                                                         : "warning",
          results::RunStatusName(ending.status), ending.error);
    });
    return recorded;
  }

  // Tries again what could not be recorded.
  void RecordAgain(double lock_patience) {
    if (unrecorded_.empty()) return;
    lock_patience_ = lock_patience;
    try {
      for (; !unrecorded_.empty(); unrecorded_.pop_front()) Record(unrecorded_.front());
    } catch (const Failure&) {  // the others would meet the same
    }
    lock_patience_ = kLockPatienceSeconds;
    tried_to_record_ = ActivityClock::Now();
  }

  void ShowProgress() {
    const double now = ActivityClock::Now();
    if (now - last_shown_ < 0.25) return;
    last_shown_ = now;
    std::map<std::size_t, ActiveLine> lines;
    double active_left = 0;
    double rate = 0;
    for (const auto& [index, run] : active_) {
      lines[index] = run->line;
      if (run->line.rate > 0) {
        active_left = std::max(active_left, static_cast<double>(run->line.env_steps_target -
                                                                run->line.progress.env_step) /
                                                run->line.rate);
        rate += run->line.rate;
      }
    }
    std::string summary = std::to_string(ended_) + " of " + std::to_string(jobs_.size()) +
                          " runs ended, " + std::to_string(active_.size()) + " active, " +
                          FormatDuration(now - started_) + " so far";
    double waiting_steps = 0;
    for (std::size_t i = next_; i < jobs_.size(); ++i) {
      waiting_steps += static_cast<double>(jobs_[i].work.spec.work_steps());
    }
    if (rate > 0) {
      summary += ", about " + FormatDuration(active_left + waiting_steps / rate) + " left";
    }
    observer_->Show(lines, summary);
  }

  results::Database* database_;
  const ProcessOptions& options_;
  std::vector<SweepJob> jobs_;
  const WorkLimits limits_;
  std::size_t next_ = 0;
  std::size_t ended_ = 0;
  std::map<std::size_t, std::unique_ptr<ActiveRun>> active_;
  std::vector<std::int64_t> planned_after_;  // last segments of the jobs' runs at the beginning
  std::vector<int> exit_codes_;
  std::deque<Ending> unrecorded_;
  double tried_to_record_ = 0;
  bool said_locked_ = false;
  double lock_patience_ = kLockPatienceSeconds;
  SweepResult result_;
  SweepObserver* observer_;
  CoreSharing sharing_;
  bool shared_ = false;  // since a run began or ended
  double shared_at_ = 0;
  bool stopping_ = false;
  bool stopped_at_once_ = false;
  double started_ = 0;
  double last_shown_ = 0;
};

}  // namespace

// A shorter --hang-timeout shortens it.
double GraceSeconds(const ProcessOptions& options) {
  return options.hang_timeout_seconds > 0 ? std::min(kGraceSeconds, options.hang_timeout_seconds)
                                          : kGraceSeconds;
}

int FailureCode(const results::RunInfo& run) {
  return static_cast<int>(run.exit_code.value_or(static_cast<int>(ExitCode::kInternal)));
}

SweepResult RunSweep(results::Database* database, const ProcessOptions& options,
                     std::vector<SweepJob> jobs, SweepObserver* observer) {
  return Sweep(database, options, std::move(jobs), observer).Run();
}

}  // namespace dreamsearch
