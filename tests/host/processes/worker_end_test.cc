// What became of a worker: status, exit code and sentence for every way to end.
#include "host/processes/worker_end.h"

#include <gtest/gtest.h>

#include <fstream>

#include "host/processes/crash_report.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

constexpr int Exited(ExitCode code) { return static_cast<int>(code) << 8; }

void ExpectEnd(const WorkerEnd& end, results::RunStatus status, ExitCode code,
               const std::string& part) {
  EXPECT_EQ(end.status, status) << end.error;
  EXPECT_EQ(end.exit_code, static_cast<int>(code)) << end.error;
  EXPECT_NE(end.error.find(part), std::string::npos) << end.error;
}

TEST(WorkerEnd, AnExitIsTakenByItsCode) {
  WorkerCourse course;
  course.log = "/runs/x/run.log";
  course.error = "planner 'x' Plan: invalid";
  using results::RunStatus;
  ExpectEnd(EndOf(course, 0), RunStatus::kCrashed, ExitCode::kPluginCrashed,
            "ended with exit status 0 before the run was over; a plugin called exit? Log: "
            "/runs/x/run.log");
  course.done = true;
  ExpectEnd(EndOf(course, 0), RunStatus::kFinished, ExitCode::kOk, "");
  ExpectEnd(EndOf(course, Exited(ExitCode::kInterrupted)), RunStatus::kInterrupted,
            ExitCode::kInterrupted, "");
  ExpectEnd(EndOf(course, Exited(ExitCode::kDiverged)), RunStatus::kDiverged, ExitCode::kDiverged,
            course.error);
  // The machine's fault: the same command resumes it.
  for (const ExitCode code :
       {ExitCode::kInputOutput, ExitCode::kCannotCreate, ExitCode::kPermission}) {
    ExpectEnd(EndOf(course, Exited(code)), RunStatus::kInterrupted, code, course.error);
  }
  // The program's or a plugin's.
  for (const ExitCode code : {ExitCode::kInternal, ExitCode::kPluginRefused, ExitCode::kBadInput}) {
    ExpectEnd(EndOf(course, Exited(code)), RunStatus::kFailed, code, course.error);
  }
  course.error.clear();
  ExpectEnd(EndOf(course, Exited(ExitCode::kInternal)), RunStatus::kFailed, ExitCode::kInternal,
            "exit status 70. Log: /runs/x/run.log");
  course.asked = WorkerCourse::Asked::kTimeLimit;
  course.time_limit_seconds = 60;
  ExpectEnd(EndOf(course, Exited(ExitCode::kInterrupted)), RunStatus::kInterrupted,
            ExitCode::kInterrupted, "time limit of 60 s reached");
}

TEST(WorkerEnd, TooMuchMemoryIsSaidWithItsLimitAndTheSameCommandResumes) {
  WorkerCourse course;
  course.log = "/runs/x/run.log";
  course.stage = RunStage::kLearning;
  course.killed = WorkerCourse::Killed::kMemory;
  course.memory_bytes = 812000000;
  course.memory_limit_bytes = 500000000;
  const WorkerEnd shared = EndOf(course, SIGKILL);
  ExpectEnd(shared, results::RunStatus::kKilled, ExitCode::kPluginCrashed,
            "took 812.0 MB of memory while learning, more than its share of what was free");
  EXPECT_NE(shared.error.find("(500.0 MB)"), std::string::npos) << shared.error;
  EXPECT_NE(shared.error.find("the same command resumes it"), std::string::npos) << shared.error;
  EXPECT_FALSE(results::HasFailed(shared.status));
  course.memory_limit_given = true;
  ExpectEnd(EndOf(course, SIGKILL), results::RunStatus::kKilled, ExitCode::kPluginCrashed,
            "more than --memory-limit allows");
}

TEST(WorkerEnd, ACrashNamesTheSignalTheStageAndTheLastLineOfTheLog) {
  const std::string log = testing::TempDir() + "worker_end_test.log";
  std::ofstream(log) << "first\nlast words\n\n";
  WorkerCourse course;
  course.log = log;
  course.stage = RunStage::kLearning;
  const WorkerEnd end = EndOf(course, SIGSEGV);
  ExpectEnd(end, results::RunStatus::kCrashed, ExitCode::kPluginCrashed, "signal 11");
  EXPECT_NE(end.error.find("while learning: last words. Log: " + log), std::string::npos)
      << end.error;
  std::filesystem::remove(log);
}

TEST(WorkerEnd, ACrashReportSaysInWhichCall) {
  const std::string log = testing::TempDir() + "worker_end_report.log";
  std::ofstream(log)
      << "last words\n\n*** in planner 'cem' Plan, decision 12\n/x/p.so(+0x12)[0x1]\n";
  WorkerCourse course;
  course.log = log;
  course.stage = RunStage::kLearning;
  ExpectEnd(EndOf(course, SIGSEGV), results::RunStatus::kCrashed, ExitCode::kPluginCrashed,
            "while learning, in planner 'cem' Plan, decision 12: last words. Log: " + log);
  // Of a hang the report was asked for, with a signal of its own.
  course.killed = WorkerCourse::Killed::kHang;
  course.patience_seconds = 60;
  for (const int signal : {SIGABRT, SIGKILL}) {
    ExpectEnd(EndOf(course, signal), results::RunStatus::kCrashed, ExitCode::kPluginCrashed,
              "made no progress for 60 s of processor time while learning, in planner 'cem' Plan, "
              "decision 12; a plugin hangs");
  }
  course.idle_seconds = 600;
  ExpectEnd(EndOf(course, SIGABRT), results::RunStatus::kCrashed, ExitCode::kPluginCrashed,
            "waited for 10 min without working while learning, in planner 'cem' Plan");
  std::filesystem::remove(log);
}

TEST(WorkerEnd, AnExitInsideACallSaysInWhichCall) {
  const std::string log = testing::TempDir() + "worker_end_exit.log";
  std::ofstream(log) << "\n*** in planner 'cem' Plan, decision 12\n";
  WorkerCourse course;
  course.log = log;
  for (const int status : {0, 3}) {
    ExpectEnd(EndOf(course, status << 8), results::RunStatus::kCrashed, ExitCode::kPluginCrashed,
              "ended with exit status " + std::to_string(status) +
                  " before the run was over, in planner 'cem' Plan, decision 12; a plugin called "
                  "exit? Log: " +
                  log);
  }
  std::filesystem::remove(log);
}

// The log goes on where the run does: what a crashed worker left there is not the next one's.
TEST(WorkerEnd, AnswersForItsOwnPartOfTheLogAlone) {
  const std::string log = testing::TempDir() + "worker_end_parts.log";
  const std::string before = "last words\n\n*** in planner 'cem' Plan, decision 12\n";
  std::ofstream(log) << before << kOwnMark << "interrupted at environment step 7\n";
  WorkerCourse course;
  course.log = log;
  course.log_begin = static_cast<std::int64_t>(before.size());
  course.asked = WorkerCourse::Asked::kStop;
  ExpectEnd(EndOf(course, 75 << 8), results::RunStatus::kInterrupted, ExitCode::kInterrupted, "");
  const WorkerEnd crashed = EndOf(course, SIGSEGV);
  EXPECT_EQ(crashed.error.find("cem"), std::string::npos) << crashed.error;
  EXPECT_EQ(crashed.error.find("last words"), std::string::npos) << crashed.error;
  std::filesystem::remove(log);
}

TEST(WorkerEnd, WhatTheWorkerWroteItselfIsNotAPluginsLastLine) {
  const std::string log = testing::TempDir() + "worker_end_own.log";
  const std::string report = "\n*** in planner 'cem' Plan, decision 12\n";
  WorkerCourse course;
  course.log = log;
  course.stage = RunStage::kLearning;
  std::ofstream(log) << kOwnMark << "threads: 2 from environment step 0\n" << report;
  ExpectEnd(EndOf(course, SIGSEGV), results::RunStatus::kCrashed, ExitCode::kPluginCrashed,
            "in planner 'cem' Plan, decision 12. Log: " + log);
  std::ofstream(log) << "said\n" << kOwnMark << "threads: 2 from environment step 0\n" << report;
  ExpectEnd(EndOf(course, SIGSEGV), results::RunStatus::kCrashed, ExitCode::kPluginCrashed,
            "in planner 'cem' Plan, decision 12: said. Log: " + log);
  std::filesystem::remove(log);
}

TEST(WorkerEnd, WhoWasKilledIsToldWhy) {
  using results::RunStatus;
  WorkerCourse course;
  course.stage = RunStage::kInteracting;
  course.patience_seconds = 60;
  course.grace_seconds = 20;
  course.time_limit_seconds = 600;
  ExpectEnd(EndOf(course, SIGKILL), RunStatus::kKilled, ExitCode::kPluginCrashed,
            "killed from outside");
  course.killed = WorkerCourse::Killed::kHang;
  ExpectEnd(EndOf(course, SIGKILL), RunStatus::kCrashed, ExitCode::kPluginCrashed,
            "made no progress for 60 s of processor time while interacting");
  course.killed = WorkerCourse::Killed::kOverdue;
  course.asked = WorkerCourse::Asked::kTimeLimit;
  ExpectEnd(EndOf(course, SIGKILL), RunStatus::kKilled, ExitCode::kPluginCrashed,
            "did not stop within 20 s of its time limit of 10 min");
  course.asked = WorkerCourse::Asked::kStop;
  ExpectEnd(EndOf(course, SIGKILL), RunStatus::kKilled, ExitCode::kPluginCrashed,
            "of being asked to while interacting");
  course.killed = WorkerCourse::Killed::kStop;
  ExpectEnd(EndOf(course, SIGKILL), RunStatus::kInterrupted, ExitCode::kInterrupted,
            "stopped at once");
  // A stop signal ends a worker that has not yet learned to catch it.
  ExpectEnd(EndOf(course, SIGTERM), RunStatus::kInterrupted, ExitCode::kInterrupted,
            "before it could checkpoint");
}

}  // namespace
}  // namespace dreamsearch
