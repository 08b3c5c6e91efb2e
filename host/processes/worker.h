// worker.h - the process that works on one run.
//
// A worker is started by the supervisor with a WorkerJob on its standard input.
// It alone loads plugins, writes the run's rows and holds the run's lock. Its
// standard output and error are the run's log; reports go to descriptor 3, the
// number of threads it may use is in memory behind descriptor 4.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "host/settings/retry.h"
#include "host/settings/settings.h"

namespace dreamsearch {

struct WorkerJob {
  RunSpec spec;
  std::string db;  // absolute path
  std::int64_t run_id = 0;
  // The run's last segment when this job was given; another one since then means that another
  // process has resumed the run.
  std::int64_t after_segment = -1;
  std::filesystem::path folder;  // the run's: checkpoints, log, dumps
  // Of an evaluation of a trained run: that run's checkpoint.
  std::filesystem::path agent_checkpoint;
  std::uint32_t evaluation_threads = 1;  // on which an evaluation plays its episodes
  int nice = 0;                          // added to its niceness
  std::uint32_t grace_seconds = 60;      // to checkpoint and end once its supervisor is gone
  bool log_decisions = false;
  bool record_trees = false;
  bool keep_replay = false;    // so that the run can be extended when it has finished
  std::vector<Retry> retries;  // of the run; the last one is this job's if `retried`
  bool retried = false;
  bool force = false;  // resume under another instruction set

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("spec", &spec);
    (*archive)("db", &db);
    (*archive)("run_id", &run_id);
    (*archive)("after_segment", &after_segment);
    (*archive)("folder", &folder);
    (*archive)("agent_checkpoint", &agent_checkpoint);
    (*archive)("evaluation_threads", &evaluation_threads);
    (*archive)("nice", &nice);
    (*archive)("grace_seconds", &grace_seconds);
    (*archive)("log_decisions", &log_decisions);
    (*archive)("record_trees", &record_trees);
    (*archive)("keep_replay", &keep_replay);
    (*archive)("retries", &retries);
    (*archive)("retried", &retried);
    (*archive)("force", &force);
  }
};

std::string EncodeJob(const WorkerJob& job);
WorkerJob DecodeJob(const std::string& text);

// Works on the job read from standard input. Returns the exit status: 0 finished,
// 75 interrupted, else as in error.h.
int WorkerMain();

// The same in this process, on one thread, for a debugger or a profiler: messages go to standard
// error, a crash ends this process. What a Failure said is left in *error.
int WorkHere(const WorkerJob& job, std::string* error);

}  // namespace dreamsearch
