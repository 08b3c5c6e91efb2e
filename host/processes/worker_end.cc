#include "host/processes/worker_end.h"

#include <sys/wait.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "host/processes/child_process.h"
#include "host/processes/crash_report.h"
#include "host/processes/stop_signals.h"
#include "results/system/error.h"
#include "results/system/machine_fault.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// So much of a log is searched for its last line.
constexpr std::streamoff kLogEndBytes = 64 << 10;

// What a worker's part of a log says at its end; a plugin may have filled it.
struct LastWords {
  std::string line;   // the plugin's last one: a crash report and what follows is left out
  std::string where;  // " in planner 'cem' Plan, decision 12", if a crash report says so
};
LastWords ReadLastWords(const WorkerCourse& course) {
  constexpr std::size_t kMost = 300;
  std::ifstream file(course.log);
  file.seekg(0, std::ios::end);
  file.seekg(
      std::max<std::streamoff>(course.log_begin, std::streamoff(file.tellg()) - kLogEndBytes));
  LastWords words;
  std::string last;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(kCrashMark)) {
      words.line = last;
      words.where = ", in " + line.substr(std::size(kCrashMark) - 1, kMost);
    } else if (!line.empty() && !line.starts_with(kOwnMark)) {
      last = line.substr(0, kMost);
    }
  }
  if (words.where.empty()) words.line = last;
  return words;
}

bool IsStopSignal(int signal) {
  return signal == StopRequestSignal() ||
         std::find(std::begin(kStopSignals), std::end(kStopSignals), signal) !=
             std::end(kStopSignals);
}

WorkerEnd Killed(const WorkerCourse& course) {
  const int crashed = static_cast<int>(ExitCode::kPluginCrashed);
  const std::string doing = std::string(" while ") + RunStageName(course.stage);
  const std::string log = "Log: " + course.log.string();
  switch (course.killed) {
    case WorkerCourse::Killed::kHang:
      return {
          results::RunStatus::kCrashed, crashed,
          (course.idle_seconds > 0
               ? "waited for " + FormatDuration(course.idle_seconds) + " without working" + doing
               : "made no progress for " + FormatDuration(course.patience_seconds) +
                     " of processor time" + doing) +
              ReadLastWords(course).where + "; a plugin hangs, or --hang-timeout is too short. " +
              log};
    case WorkerCourse::Killed::kMemory:
      return {results::RunStatus::kKilled, crashed,
              "took " + FormatBytes(static_cast<double>(course.memory_bytes)) + " of memory" +
                  doing + ", more than " +
                  (course.memory_limit_given ? "--memory-limit allows"
                                             : "its share of what was free when the sweep began") +
                  " (" + FormatBytes(static_cast<double>(course.memory_limit_bytes)) +
                  "). Give it more with --memory-limit or fewer --jobs, or lower "
                  "run.replay_capacity; the same command resumes it. " +
                  log};
    case WorkerCourse::Killed::kOverdue:
      return {results::RunStatus::kKilled, crashed,
              "did not stop within " + FormatDuration(course.grace_seconds) + " of " +
                  (course.asked == WorkerCourse::Asked::kTimeLimit
                       ? "its time limit of " + FormatDuration(course.time_limit_seconds)
                       : "being asked to") +
                  doing + ". The same command resumes it. " + log};
    case WorkerCourse::Killed::kStop:
      return {results::RunStatus::kInterrupted, static_cast<int>(ExitCode::kInterrupted),
              "stopped at once"};
    case WorkerCourse::Killed::kNo:
      break;
  }
  return {results::RunStatus::kKilled, crashed,
          "killed from outside (out of memory?). The same command resumes it"};
}

}  // namespace

results::RunStatus StatusOf(ExitCode code) {
  if (code == ExitCode::kDiverged) return results::RunStatus::kDiverged;
  if (code == ExitCode::kInterrupted || IsOfTheMachine(code)) {
    return results::RunStatus::kInterrupted;
  }
  return results::RunStatus::kFailed;
}

WorkerEnd EndOf(const WorkerCourse& course, int wait_status) {
  const int crashed = static_cast<int>(ExitCode::kPluginCrashed);
  const int interrupted = static_cast<int>(ExitCode::kInterrupted);
  const std::string log = ". Log: " + course.log.string();
  if (WIFSIGNALED(wait_status)) {
    const int signal = WTERMSIG(wait_status);
    if (signal == SIGKILL || course.killed == WorkerCourse::Killed::kHang) return Killed(course);
    if (course.asked != WorkerCourse::Asked::kNo && IsStopSignal(signal)) {
      return {results::RunStatus::kInterrupted, interrupted, "ended before it could checkpoint"};
    }
    const LastWords words = ReadLastWords(course);
    return {results::RunStatus::kCrashed, crashed,
            "crashed with " + DescribeWaitStatus(wait_status) + " while " +
                RunStageName(course.stage) + words.where +
                (words.line.empty() ? "" : ": " + words.line) + log};
  }
  const int code = WEXITSTATUS(wait_status);
  if (code == 0 && course.done) return {results::RunStatus::kFinished, 0, ""};
  const std::string where = course.error.empty() ? ReadLastWords(course).where : "";
  if (code == 0 || !where.empty()) {
    return {results::RunStatus::kCrashed, crashed,
            "its process ended with " + DescribeWaitStatus(wait_status) +
                " before the run was over" + where + "; a plugin called exit?" + log.substr(1)};
  }
  if (code == interrupted) {
    return {results::RunStatus::kInterrupted, interrupted,
            course.asked == WorkerCourse::Asked::kTimeLimit
                ? "time limit of " + FormatDuration(course.time_limit_seconds) + " reached"
                : ""};
  }
  return {StatusOf(static_cast<ExitCode>(code)), code,
          course.error.empty() ? DescribeWaitStatus(wait_status) + log : course.error};
}

}  // namespace dreamsearch
