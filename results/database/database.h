// database.h - the results database: opening it, and the rows that say what a
// run is. What a run does is written by RunWriter.
//
// Errors   every call throws Failure, which carries an exit code: 65 not
//          our database, damaged, or of a newer schema; 66 no such file; 73 cannot
//          be created; 74 disk full, input/output error, locked for 30 s, deleted
//          while open, or of an older schema with a run still active; 77 permission.
//          A failed call has stored nothing.
// Schema   opening an older file brings it up to date, but not while a run of it is
//          active: the program of that run would not know the new schema.
// Writers  any number of processes may hold one file open; each change is one
//          short BEGIN IMMEDIATE transaction that waits its turn.
// Threads  one thread uses a Database; it is not carried over fork().
// Text     names and paths are data and may hold anything but NUL.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "results/database/sqlite.h"
#include "results/system/digest.h"
#include "results/system/error.h"
#include "results/system/sha256.h"

namespace dreamsearch::results {

enum class RunStatus {
  kQueued,
  kRunning,
  kFinished,
  kInterrupted,
  kFailed,
  kCrashed,
  kDiverged,
  kKilled,
};
const char* RunStatusName(RunStatus status);
// Whether the run ended by a fault of its own, so that it is not tried again unasked.
constexpr bool HasFailed(RunStatus status) {
  return status == RunStatus::kFailed || status == RunStatus::kCrashed ||
         status == RunStatus::kDiverged;
}
// Throws Failure 65 for an unknown name.
RunStatus ParseRunStatus(const std::string& name);

struct TaskInfo {
  std::string name;    // first of the task's names: cup_catch
  std::string domain;  // what it is a task of: ball_in_cup; may be empty
  std::int64_t observation_size = 0;
  std::int64_t action_size = 0;
  double control_seconds = 0;  // simulated seconds of one environment step
  std::int64_t substeps = 0;
  std::int64_t episode_steps = 0;  // environment steps until the time limit
  double return_low = 0;           // range of an episode's return; equal when there is
  double return_high = 0;          //   none, and then there is no normalised score

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("name", &name);
    (*archive)("domain", &domain);
    (*archive)("observation_size", &observation_size);
    (*archive)("action_size", &action_size);
    (*archive)("control_seconds", &control_seconds);
    (*archive)("substeps", &substeps);
    (*archive)("episode_steps", &episode_steps);
    (*archive)("return_low", &return_low);
    (*archive)("return_high", &return_high);
  }
};

struct PluginRow {
  std::string name;
  std::string version;
  std::string abi;     // version of the SDK it was built against, "1.0"
  std::string file;    // path it was loaded from
  std::string sha256;  // of the file
};

struct BuildInfo {
  std::string version;   // of the project
  std::string commit;    // empty when unknown
  bool dirty = false;    // built from a changed tree
  std::string compiler;  // "g++ 12.2.0"
  std::string flags;
  std::string instruction_set;  // what the numeric code was built for
  std::string libraries;        // JSON object, library to version
};

struct HostInfo {
  std::string hostname;
  std::string cpu;
  std::int64_t cores = 0;
  std::int64_t memory_bytes = 0;
  std::string os;
};

// What makes a run that run. Two runs of one file never share a key; a run that
// names a parent (`runner eval`) has a key space of its own below that parent.
struct RunKey {
  std::string study = "default";
  std::string task;
  std::string planner;
  std::string model;
  std::string config_sha256;  // Sha256Hex of the canonical configuration
  std::int64_t seed = 0;
  std::int64_t action_repeat = 1;
  std::optional<std::int64_t> parent_run_id;
};

// A run to be recorded; the ids come from the calls of Database below.
struct NewRun {
  std::int64_t study_id = 0;
  std::int64_t task_id = 0;
  std::string planner;
  std::string model;
  std::optional<std::int64_t> env_plugin;
  std::optional<std::int64_t> model_plugin;
  std::optional<std::int64_t> planner_plugin;
  std::int64_t config_id = 0;
  std::string preset;
  std::int64_t seed = 0;
  std::int64_t action_repeat = 1;
  std::int64_t env_steps_target = 0;
  std::optional<std::int64_t> parent_run_id;
  std::string argv;  // the command line, as a JSON array
  std::int64_t build_id = 0;
  std::string log_name = "run.log";  // file name in the run's folder
};

struct CreatedRun {
  std::int64_t run_id = 0;
  std::string uuid;
  bool created = false;  // false: another process had made this run already
};

// The plugin that a component of a run was loaded from; empty texts where it is not known.
struct LoadedPlugin {
  std::string name, version, sha256;
};

// A run as it stands, with the names behind its ids.
struct RunInfo {
  std::int64_t run_id = 0;
  std::string uuid;
  std::string study;
  std::string task;
  std::string planner;
  std::string model;
  std::optional<std::int64_t> env_plugin;
  std::optional<std::int64_t> model_plugin;
  std::optional<std::int64_t> planner_plugin;
  std::int64_t config_id = 0;
  std::string config_json;
  std::string config_sha256;
  std::string preset;
  std::int64_t seed = 0;
  std::int64_t action_repeat = 1;
  std::int64_t env_steps_target = 0;
  std::int64_t env_steps_done = 0;
  RunStatus status = RunStatus::kQueued;
  std::optional<std::int64_t> parent_run_id;
  std::string log_path;  // relative to the folder of the database
  std::optional<std::int64_t> exit_code;
  std::string error;
  std::string argv;
  std::int64_t build_id = 0;
  std::string created_utc;
  std::string ended_utc;               // empty while it has not ended
  std::string heartbeat_utc;           // empty before the first
  double heartbeat_age_seconds = 0;    // by this machine's clock; infinite before the first
  std::string result_digest;           // empty until it has finished
  std::int64_t last_segment = -1;      // -1: nobody has worked on it yet
  std::array<LoadedPlugin, 3> loaded;  // of environment, model and planner
};

// Whose end a status is.
struct WorkerInfo {
  std::int64_t pid = -1;
  std::int64_t after_segment = -1;  // the run's last_segment when the worker was started
};

// A worker shows a heartbeat every second. One that has shown none for so long is
// taken for gone.
inline constexpr double kAliveSeconds = 60;
inline bool IsActive(const RunInfo& run) {
  return run.status == RunStatus::kRunning && run.heartbeat_age_seconds < kAliveSeconds;
}

// An episode as far as progress and status need it; times in microseconds a decision.
struct EpisodeInfo {
  int phase = 0;  // as the column
  std::int64_t episode = 0;
  std::int64_t length = 0;               // environment steps
  std::optional<double> episode_return;  // nullopt: was not finite
  double plan_us_mean = 0;
  std::int64_t model_transitions = 0;
};

// Empty lists let everything through.
struct RunFilter {
  std::vector<std::string> studies;
  std::vector<std::string> tasks;
  std::vector<std::string> planners;
  std::vector<std::int64_t> seeds;
  std::vector<RunStatus> statuses;
  bool with_evaluations = true;  // runs that name a parent, or that trained for 0 steps
};

class Database {
 public:
  // Opens the file, or makes it and its folders. Where a write-ahead log is not safe
  // (file_system.h) it uses a rollback journal and says so in warnings().
  static std::unique_ptr<Database> OpenOrCreate(const std::string& path);
  // Opens an existing file for changes; Failure 66 when there is none.
  static std::unique_ptr<Database> OpenExisting(const std::string& path);
  // Opens an existing file and changes nothing in it but an older schema. Failure 77 for
  // an older schema in a file that may not be written.
  static std::unique_ptr<Database> OpenReadOnly(const std::string& path);

  // Throws what OpenOrCreate would for a place where nothing can be written; creates nothing.
  static void CheckWritable(const std::string& path);

  // Absolute, links resolved: a file opened through a link has the same folders.
  const std::string& path() const { return connection_->path(); }
  const std::vector<std::string>& warnings() const { return warnings_; }
  Connection& connection() { return *connection_; }

  // Checkpoints, logs and dumps of a run: "<path>.files/<uuid>", or if that is not there
  // the folder of its log, which of a merged run is where its source had it. Not created
  // here.
  std::string RunFolder(const RunInfo& run) const { return RunFolderAt(path(), run); }
  // The same of a database at another path, which may be none yet.
  static std::string RunFolderAt(const std::string& path, const RunInfo& run);
  // Tables, indices, triggers and views that this program makes and that this file has otherwise or
  // lacks, and triggers that it has besides: "table step". Of a file of the newest schema.
  std::vector<std::string> ChangedSchema();
  // Who worked on it last: "process 4711 of node7". "another process" if none has.
  std::string LastWorker(std::int64_t run_id);
  // "<path>.files/<uuid>", whatever is there.
  std::string OwnFolder(const RunInfo& run) const { return NewRunFolder(path(), run.uuid); }
  // A path below the database's folder as it is stored; others stay as they are.
  std::string RelativePath(const std::string& path) const;

  // What runs share: each returns the id of the row that says this, adding it if it is
  // new. A task of a known name but other values is a Failure 65: its curves must
  // not be averaged with the old ones.
  std::int64_t Study(const std::string& name, const std::string& description = "");
  std::int64_t Task(const TaskInfo& task);
  std::int64_t Plugin(const PluginRow& plugin);
  std::int64_t Config(const std::string& canonical_json);
  std::int64_t Build(const BuildInfo& build);
  std::int64_t Host(const HostInfo& host);
  PluginRow GetPlugin(std::int64_t plugin_id);
  BuildInfo GetBuild(std::int64_t build_id);

  std::optional<RunInfo> FindRun(const RunKey& key);
  // Records a run as queued under a new UUID. When another process has recorded
  // the same key meanwhile, returns that run.
  CreatedRun CreateRun(const NewRun& run);
  // Ends or re-opens a run. A status other than queued and running sets ended_utc
  // and closes the open segment with the status as its reason. With `worker`, returns
  // false and changes nothing if another process has begun a segment since that worker
  // or has deleted the run; otherwise a run that is not there is a Failure 66.
  bool SetRunStatus(std::int64_t run_id, RunStatus status,
                    std::optional<int> exit_code = std::nullopt, const std::string& error = "",
                    const std::optional<WorkerInfo>& worker = std::nullopt);
  // Plugins or configuration of an unfinished run changed with the user's leave:
  // replaces the row's settings, keeps its identity, deletes what it did so far. Its
  // files are from then on in OwnFolder.
  void ReplaceRun(std::int64_t run_id, const NewRun& run);
  // Deletes the run, everything it recorded, and the evaluations below it. Files
  // in its folder stay.
  void DeleteRun(std::int64_t run_id);

  std::vector<RunInfo> ListRuns(const RunFilter& filter = {});
  std::optional<RunInfo> GetRun(std::int64_t run_id);
  // By run_id, or by the beginning of a UUID (4 characters or more). Failure 66 for
  // none, naming what there is; Failure 2 for more than one.
  RunInfo GetRun(const std::string& id_or_uuid);

  // A run's episodes in the order of phase and episode.
  std::vector<EpisodeInfo> ListEpisodes(std::int64_t run_id);

  // The last recorded value of a metric, such as "mcts_pw.q_gain"; nothing if there is none.
  std::optional<double> LastScalar(std::int64_t run_id, const std::string& metric);

  // The absolute path of the recorded file of that kind with the largest env_step; empty
  // if the run has recorded none.
  std::string LastArtifact(std::int64_t run_id, const std::string& kind);

  // What the supervisor has to say about a run it does not write itself.
  void AddEvent(std::int64_t run_id, std::int64_t env_step, const std::string& level,
                const std::string& kind, const std::string& detail);

  // SHA-256 over (phase, episode, env_step, length, return, digest) of every
  // episode, in the order of phase and episode; never over times.
  std::string ComputeResultDigest(std::int64_t run_id);

 private:
  Database(const std::string& path, OpenMode mode);
  static std::string NewRunFolder(const std::string& path, const std::string& uuid);
  void LeaveWriteAhead(OpenMode mode, OpenMode opened);
  void Prepare(OpenMode mode);
  std::optional<std::int64_t> SchemaOfTables();
  void DistrustViews();
  void Mark(std::int64_t schema, OpenMode mode);
  void Migrate();

  std::unique_ptr<Connection> connection_;
  std::vector<std::string> warnings_;
};

// Now, in UTC: 2026-11-22T03:05:59.123Z.
std::string UtcNow();
// A random (version 4) UUID.
std::string NewUuid();

}  // namespace dreamsearch::results
