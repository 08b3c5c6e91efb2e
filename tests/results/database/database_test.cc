// Databases of every age are opened, brought up to date, or refused with a sentence.
// Over 400 lines: the tests of one class, on one fixture.
#include "results/database/database.h"

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "results/database/schema.h"
#include "results/system/error.h"
#include "results/system/sha256.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

ExitCode ExitCodeOf(const std::function<void()>& call, const std::string& names = "") {
  try {
    call();
  } catch (const Failure& error) {
    EXPECT_NE(std::string(error.what()).find(names), std::string::npos) << error.what();
    return error.code();
  }
  return ExitCode::kOk;
}

void Write(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST(Database, IsMadeWithItsFoldersAndMarks) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "a/b/c.db");
  EXPECT_EQ(Count(db.get(), "PRAGMA application_id"), kApplicationId);
  EXPECT_EQ(Count(db.get(), "PRAGMA user_version"), SchemaVersion());
  EXPECT_EQ(Count(db.get(), "PRAGMA foreign_keys"), 1);
  EXPECT_EQ(Count(db.get(), "PRAGMA synchronous"), 2);
  EXPECT_EQ(db->connection().QueryText("PRAGMA journal_mode"), "wal");
  EXPECT_EQ(db->connection().QueryText("PRAGMA integrity_check"), "ok");
  EXPECT_TRUE(db->warnings().empty());
}

// The public contract: the tables and columns people write SQL against.
TEST(Database, HasTheTablesAndColumnsOfTheContract) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  for (const char* query :
       {"SELECT study_id, name, description, created_utc FROM study",
        "SELECT run_id, uuid, study_id, task_id, planner, model, env_plugin, model_plugin,"
        " planner_plugin, config_id, preset, seed, action_repeat, env_steps_target,"
        " env_steps_done, status, parent_run_id, log_path, exit_code, error, argv, build_id,"
        " created_utc, ended_utc, heartbeat_utc, result_digest FROM run",
        "SELECT run_id, segment, host_id, pid, from_env_step, to_env_step, started_utc,"
        " ended_utc, end_reason, rows_rolled_back, slurm_job FROM segment",
        "SELECT run_id, env_step, episode, t, reward, value, plan_us, simulations, nodes, depth"
        " FROM step",
        "SELECT run_id, phase, episode, env_step, length, episode_return, wall_s, plan_us_mean,"
        " plan_us_p95, model_transitions, digest FROM episode",
        "SELECT run_id, metric_id, env_step, value FROM scalar",
        "SELECT metric_id, name, unit, doc FROM metric",
        "SELECT run_id, env_step, activity, seconds FROM time_use",
        "SELECT run_id, phase, env_step_bin, n, sum_return, nonfinite FROM curve_bin",
        "SELECT source, method, obs, task, env_steps, seed, episode_return FROM published",
        "SELECT run_id, seq, env_step, utc, level, kind, detail FROM event",
        "SELECT run_id, path, kind, env_step, bytes, sha256 FROM artifact",
        "SELECT run_id, tbl, first_step, last_step, n_rows, digest FROM chunk_digest",
        "SELECT study, task, planner, phase, env_step_bin, mean, lo, hi, seeds FROM v_curve",
        "SELECT * FROM v_run", "SELECT * FROM v_curve_run", "SELECT * FROM v_final",
        "SELECT planner, activity, seconds FROM v_time", "SELECT * FROM v_matrix"}) {
    EXPECT_NO_THROW(db->connection().Prepare(query)) << query;
  }
  // STRICT everywhere: a text in a number's place is refused.
  EXPECT_EQ(Count(db.get(),
                  "SELECT count(*) FROM pragma_table_list WHERE schema = 'main' AND"
                  " type = 'table' AND strict = 0 AND name NOT LIKE 'sqlite_%'"),
            0);
}

TEST(Database, OpeningItAgainFindsWhatWasThere) {
  const TemporaryFolder folder;
  std::int64_t run = 0;
  {
    const auto db = Database::OpenOrCreate(folder / "r.db");
    run = MakeRun(db.get());
  }
  const auto db = Database::OpenOrCreate(folder / "r.db");
  EXPECT_EQ(db->GetRun(run)->task, "walker_walk");
  const auto reader = Database::OpenReadOnly(folder / "r.db");
  EXPECT_EQ(reader->GetRun(run)->task, "walker_walk");
  EXPECT_NE(ExitCodeOf([&] { reader->Study("new"); }), ExitCode::kOk);
}

TEST(Database, AReaderLeavesNoFilesBehind) {
  const TemporaryFolder folder;
  MakeRun(Database::OpenOrCreate(folder / "r.db").get());
  EXPECT_EQ(Database::OpenReadOnly(folder / "r.db")->ListRuns().size(), 1u);
  EXPECT_FALSE(std::filesystem::exists(folder / "r.db-wal"));
  EXPECT_FALSE(std::filesystem::exists(folder / "r.db-shm"));
}

// Root ignores file modes, so the check drops to another user.
TEST(Database, AReadOnlyFolderCanBeReadAndNotWritten) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root to become another user";
  const TemporaryFolder folder;
  MakeRun(Database::OpenOrCreate(folder / "r?%41.db").get());
  std::filesystem::permissions(folder.path(), std::filesystem::perms(0555));
  std::filesystem::permissions(folder / "r?%41.db", std::filesystem::perms(0444));
  const pid_t child = fork();
  if (child == 0) {
    if (setgid(65534) != 0 || setuid(65534) != 0) _exit(100);
    int failures = 0;
    try {
      failures += Database::OpenReadOnly(folder / "r?%41.db")->ListRuns().size() != 1;
    } catch (const Failure& error) {
      std::fprintf(stderr, "%s\n", error.what());
      failures += 2;
    }
    failures += 4 * (ExitCodeOf([&] { Database::OpenOrCreate(folder / "r?%41.db"); }) !=
                     ExitCode::kPermission);
    failures += 8 * (ExitCodeOf([&] { Database::OpenOrCreate(folder / "new.db"); }) !=
                     ExitCode::kPermission);
    _exit(failures);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  std::filesystem::permissions(folder.path(), std::filesystem::perms(0755));
}

TEST(Database, AFileThatIsNotOursIsRefusedAndUntouched) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.db";
  Write(path,
        "This is a text of more than a hundred bytes, which is what an SQLite file's header "
        "has, and no database at all, nor will it become one.");
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenOrCreate(path); }, path), ExitCode::kBadInput);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenReadOnly(path); }, path), ExitCode::kBadInput);
  std::ifstream file(path);
  std::string word;
  EXPECT_TRUE(file >> word);
  EXPECT_EQ(word, "This");
  EXPECT_FALSE(std::filesystem::exists(path + "-wal"));
}

TEST(Database, AnotherProgramsSqliteFileIsRefusedAndUntouched) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.db";
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &other), SQLITE_OK);
  sqlite3_exec(other, "CREATE TABLE bookmarks (url TEXT)", nullptr, nullptr, nullptr);
  sqlite3_close(other);
  const auto size = std::filesystem::file_size(path);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenOrCreate(path); }, "another program"),
            ExitCode::kBadInput);
  EXPECT_EQ(std::filesystem::file_size(path), size);
}

TEST(Database, ATruncatedFileIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.db";
  {
    const auto db = Database::OpenOrCreate(path);
    MakeRun(db.get());
  }
  for (const std::uintmax_t size : {50u, 100u, 1000u, 4096u, 9000u}) {
    std::filesystem::resize_file(path, size);
    EXPECT_EQ(ExitCodeOf([&] { Database::OpenReadOnly(path)->ListRuns(); }), ExitCode::kBadInput)
        << size;
  }
}

TEST(Database, ANewerSchemaIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.db";
  Database::OpenOrCreate(path)->connection().Execute("PRAGMA user_version = 99");
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenOrCreate(path); }, "schema 99"), ExitCode::kBadInput);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenReadOnly(path); }, "schema 99"), ExitCode::kBadInput);
}

// Migrations go forward only: a file of each older schema, with a run in it, becomes
// the newest one and keeps its rows.
TEST(Database, OlderSchemasAreBroughtUpToDate) {
  for (std::int64_t version = 1; version < SchemaVersion(); ++version) {
    const TemporaryFolder folder;
    const std::string path = folder / "old.db";
    {
      Connection old(path, OpenMode::kCreate);
      for (std::int64_t v = 0; v < version; ++v) {
        old.Execute(Migrations()[static_cast<std::size_t>(v)]);
      }
      // A view of its time, and one that somebody made.
      old.Execute("CREATE VIEW v_final AS SELECT 'old' AS study; CREATE VIEW mine AS SELECT 7");
      old.Execute("PRAGMA application_id = " + std::to_string(kApplicationId) +
                  "; PRAGMA user_version = " + std::to_string(version) +
                  "; INSERT INTO study VALUES (1, 'kept', '', 'then');"
                  " INSERT INTO task VALUES (1, 't', '', 1, 1, 1, 1, 1, 0, 1);"
                  " INSERT INTO config VALUES (1, 'x', '{}');"
                  " INSERT INTO build VALUES (1, '', '', 0, '', '', '', '');"
                  " INSERT INTO run (run_id, uuid, study_id, task_id, planner, model, config_id,"
                  " preset, seed, action_repeat, env_steps_target, log_path, argv, build_id,"
                  " created_utc) VALUES (1, 'u', 1, 1, 'p', 'm', 1, '', 0, 1, 1, '', '', 1, '');"
                  " INSERT INTO chunk_digest VALUES (1, 'step', 1, 10000, 3, 4);"
                  " INSERT INTO metric (name, unit, doc) VALUES ('loss', '', 'a loss')");
    }
    const auto reader = Database::OpenReadOnly(path);
    EXPECT_EQ(Count(reader.get(), "PRAGMA user_version"), SchemaVersion());
    EXPECT_EQ(reader->GetRun(1)->study, "kept");
    EXPECT_EQ(Count(reader.get(), "SELECT n_rows FROM chunk_digest"), 3);
    EXPECT_EQ(reader->connection().QueryText("SELECT doc_sha256 FROM metric"), Sha256Hex("a loss"));
    EXPECT_EQ(reader->connection().QueryText("SELECT sha256 FROM study"),
              Sha256Hex("kept\n\nthen"));
    EXPECT_EQ(reader->connection().QueryText("SELECT log_path_sha256 FROM run"), Sha256Hex(""));
    EXPECT_EQ(Count(reader.get(), "SELECT count(*) FROM v_final"), 0);
    EXPECT_EQ(Count(reader.get(), "SELECT count(*) FROM v_run"), 1);
    EXPECT_EQ(Count(reader.get(), "SELECT * FROM mine"), 7);
    const auto writer = Database::OpenOrCreate(path);
    EXPECT_NO_THROW(writer->SetRunStatus(1, RunStatus::kFailed, 70));
    EXPECT_EQ(writer->connection().QueryText("PRAGMA integrity_check"), "ok");
  }
}

// A damaged mark, or one that somebody set: the tables know better, and are not altered twice.
TEST(Database, AMarkThatIsOlderThanTheTablesIsMended) {
  for (std::int64_t version = 1; version < SchemaVersion(); ++version) {
    const TemporaryFolder folder;
    const std::string path = folder / "new.db";
    MakeRun(Database::OpenOrCreate(path).get(), {});
    Connection(path, OpenMode::kReadWrite)
        .Execute("PRAGMA user_version = " + std::to_string(version));
    const auto db = Database::OpenReadOnly(path);
    EXPECT_EQ(Count(db.get(), "PRAGMA user_version"), SchemaVersion());
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM v_run"), 1);
  }
}

// The older program that runs it would find a schema it does not know.
TEST(Database, AnOlderSchemaStaysWhileARunIsActive) {
  const TemporaryFolder folder;
  const std::string path = folder / "old.db";
  {
    const auto db = Database::OpenOrCreate(path);
    MakeRun(db.get(), {.seed = 0});
    MakeRun(db.get(), {.seed = 1});
    db->connection().Execute(DropViews() +
                             "; ALTER TABLE study DROP COLUMN sha256; ALTER TABLE published DROP"
                             " COLUMN sha256; ALTER TABLE run DROP COLUMN"
                             " log_path_sha256; ALTER TABLE artifact DROP COLUMN path_sha256;"
                             " PRAGMA user_version = " +
                             std::to_string(SchemaVersion() - 1));
  }
  const auto beat = [&](const std::string& status, double seconds_ago) {
    Connection old(path, OpenMode::kReadWrite);
    old.Prepare(
           "UPDATE run SET status = ?1, heartbeat_utc = strftime('%Y-%m-%dT%H:%M:%fZ', 'now',"
           " '-' || ?2 || ' seconds') WHERE run_id = 1")
        .Bind(status, seconds_ago)
        .Run();
  };
  const auto refused = [&](const std::string& names) {
    for (const auto& open :
         {Database::OpenReadOnly, Database::OpenExisting, Database::OpenOrCreate}) {
      EXPECT_EQ(ExitCodeOf([&] { open(path); }, names), ExitCode::kInputOutput);
    }
    Connection old(path, OpenMode::kReadWrite);
    EXPECT_EQ(old.QueryInt("PRAGMA user_version"), SchemaVersion() - 1);
  };
  beat("running", 5);
  refused("run 1 was active 5 s ago");
  // Ended just now; the next of the sweep is about to start.
  beat("finished", 5);
  refused("run 1 was active");
  // Its process is gone.
  beat("running", 2 * kAliveSeconds);
  EXPECT_EQ(Count(Database::OpenReadOnly(path).get(), "PRAGMA user_version"), SchemaVersion());
}

TEST(Database, AnEmptyFileBecomesADatabaseOnlyWhenAskedTo) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.db";
  Write(path, "");
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenReadOnly(path); }, "empty"), ExitCode::kBadInput);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenExisting(path); }, "empty"), ExitCode::kBadInput);
  EXPECT_NO_THROW(Database::OpenOrCreate(path));
}

TEST(Database, WhatIsMissingOrInTheWaySaysSo) {
  const TemporaryFolder folder;
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenReadOnly(folder / "no.db"); }, folder / "no.db"),
            ExitCode::kNotFound);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenExisting(folder / "no.db"); }), ExitCode::kNotFound);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenOrCreate(folder.path().string()); }, "folder"),
            ExitCode::kCannotCreate);
  Write(folder / "file", "x");
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenOrCreate(folder / "file/r.db"); }, folder / "file"),
            ExitCode::kCannotCreate);
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenOrCreate(folder / "pipe"); }, "a pipe"),
            ExitCode::kCannotCreate);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenReadOnly(folder / "pipe"); }, "a pipe"),
            ExitCode::kBadInput);
  EXPECT_EQ(ExitCodeOf([&] { Database::OpenOrCreate(""); }, "--db"), ExitCode::kUsage);
}

TEST(Database, DeletedWhileOpenIsFoundAtTheNextWrite) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  db->Study("a");
  std::filesystem::remove(folder / "r.db");
  EXPECT_EQ(ExitCodeOf([&] { db->Study("b"); }, "deleted"), ExitCode::kInputOutput);
}

TEST(Database, ADeletedWalIsFoundAtTheNextWrite) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  db->Study("a");
  db->Study("b");
  std::filesystem::remove(folder / "r.db-wal");
  EXPECT_EQ(ExitCodeOf([&] { db->Study("c"); }, "r.db-wal"), ExitCode::kInputOutput);
}

TEST(Database, ProvenanceIsStoredOnce) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  EXPECT_EQ(db->Study("a"), db->Study("a"));
  EXPECT_NE(db->Study("a"), db->Study("b"));
  EXPECT_EQ(db->Config("{}"), db->Config("{}"));
  EXPECT_NE(db->Config("{}"), db->Config(R"({"a":1})"));
  EXPECT_EQ(db->connection().QueryText("SELECT sha256 FROM config WHERE json = '{}'"),
            Sha256Hex("{}"));
  const HostInfo host = {"h", "c", 2, 1 << 30, "Debian"};
  EXPECT_EQ(db->Host(host), db->Host(host));
  const BuildInfo build = {"0.1.0", "abc", true, "g++", "-O3", "avx2", "{}"};
  EXPECT_EQ(db->Build(build), db->Build(build));
  EXPECT_EQ(db->GetBuild(db->Build(build)).dirty, true);
  const PluginRow plugin = {"p", "1", "1.0", "p.so", "00"};
  PluginRow rebuilt = plugin;
  rebuilt.sha256 = "01";
  EXPECT_EQ(db->Plugin(plugin), db->Plugin(plugin));
  EXPECT_NE(db->Plugin(plugin), db->Plugin(rebuilt));
  EXPECT_EQ(db->GetPlugin(db->Plugin(rebuilt)).sha256, "01");
}

TEST(Database, ATaskWithOtherFiguresIsRefused) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  TaskInfo task = {.name = "t", .observation_size = 3, .return_low = 0, .return_high = 1000};
  EXPECT_EQ(db->Task(task), db->Task(task));
  task.observation_size = 4;
  EXPECT_EQ(ExitCodeOf([&] { db->Task(task); }, "'t'"), ExitCode::kBadInput);
  // Without a range there is no normalised score.
  db->Task({.name = "u", .return_low = 0, .return_high = 0});
  EXPECT_EQ(Count(db.get(), "SELECT return_low IS NULL FROM task WHERE name = 'u'"), 1);
}

TEST(Database, ARunIsFoundByItsKeyAndMadeOnce) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  const NewRun run = MakeNewRun(db.get());
  RunKey key = {.study = "default",
                .task = "walker_walk",
                .planner = "mcts_pw",
                .model = "dreamer",
                .config_sha256 = Sha256Hex(R"({"run":{"steps":100000}})"),
                .seed = 0,
                .action_repeat = 2};
  EXPECT_FALSE(db->FindRun(key));
  const CreatedRun first = db->CreateRun(run);
  EXPECT_TRUE(first.created);
  const CreatedRun again = db->CreateRun(run);
  EXPECT_FALSE(again.created);
  EXPECT_EQ(again.run_id, first.run_id);
  EXPECT_EQ(again.uuid, first.uuid);
  const RunInfo found = *db->FindRun(key);
  EXPECT_EQ(found.run_id, first.run_id);
  EXPECT_EQ(found.status, RunStatus::kQueued);
  EXPECT_EQ(found.log_path, "r.db.files/" + first.uuid + "/run.log");
  EXPECT_EQ(db->RunFolder(found), (folder / "r.db.files/") + first.uuid);
  key.seed = 1;
  EXPECT_FALSE(db->FindRun(key));
  // A trained run's evaluation may have all else in common with it.
  NewRun evaluation = run;
  evaluation.parent_run_id = first.run_id;
  const CreatedRun child = db->CreateRun(evaluation);
  EXPECT_TRUE(child.created);
  key.seed = 0;
  key.parent_run_id = first.run_id;
  EXPECT_EQ(db->FindRun(key)->run_id, child.run_id);
}

TEST(Database, AUuidIsVersionFourAndFoundByItsBeginning) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  const CreatedRun run = db->CreateRun(MakeNewRun(db.get()));
  // xxxxxxxx-xxxx-4xxx-[89ab]xxx-xxxxxxxxxxxx (RFC 4122).
  const std::string form = "xxxxxxxx-xxxx-4xxx-yxxx-xxxxxxxxxxxx";
  ASSERT_EQ(run.uuid.size(), form.size());
  for (std::size_t i = 0; i < form.size(); ++i) {
    const std::string allowed = form[i] == 'x'   ? "0123456789abcdef"
                                : form[i] == 'y' ? "89ab"
                                                 : std::string(1, form[i]);
    EXPECT_NE(allowed.find(run.uuid[i]), std::string::npos) << run.uuid;
  }
  EXPECT_EQ(db->GetRun(run.uuid.substr(0, 8)).run_id, run.run_id);
  EXPECT_EQ(db->GetRun(std::to_string(run.run_id)).uuid, run.uuid);
  EXPECT_EQ(ExitCodeOf([&] { db->GetRun("zzzz"); }, "no run 'zzzz'"), ExitCode::kNotFound);
  EXPECT_EQ(ExitCodeOf([&] { db->GetRun("%"); }), ExitCode::kNotFound);
}

// The status of a worker that is no longer the last says nothing about the run.
TEST(Database, ALateStatusLeavesTheRunOfAnotherWorkerAlone) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  const std::int64_t run = MakeRun(db.get());
  EXPECT_EQ(db->GetRun(run)->last_segment, -1);
  SegmentInfo segment = MakeSegment(db.get());
  segment.pid = 100;
  RunWriter(db.get(), run).BeginSegment(segment);
  EXPECT_EQ(db->GetRun(run)->last_segment, 0);
  const auto set = [&](const WorkerInfo& worker) {
    return db->SetRunStatus(run, RunStatus::kCrashed, 71, "", worker);
  };
  // Worker 100 began segment 0; 200, which is newer, has not begun.
  EXPECT_FALSE(set({.pid = 99, .after_segment = -1}));
  EXPECT_EQ(db->GetRun(run)->status, RunStatus::kRunning);
  EXPECT_EQ(db->connection().QueryInt("SELECT count(*) FROM segment WHERE ended_utc IS NULL"), 1);
  EXPECT_TRUE(set({.pid = 100, .after_segment = -1}));
  EXPECT_EQ(db->GetRun(run)->status, RunStatus::kCrashed);
  EXPECT_TRUE(set({.pid = 200, .after_segment = 0}));
  segment.pid = 200;
  RunWriter(db.get(), run).BeginSegment(segment);
  EXPECT_FALSE(set({.pid = 100, .after_segment = -1}));
  EXPECT_EQ(db->GetRun(run)->status, RunStatus::kRunning);
  EXPECT_TRUE(set({.pid = 200, .after_segment = 0}));
  db->DeleteRun(run);
  EXPECT_FALSE(set({.pid = 200, .after_segment = 0}));
  EXPECT_FALSE(set({.pid = 200, .after_segment = -1}));
}

TEST(Database, StatusIsStoredAndEndsTheSegment) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  const std::int64_t run = MakeRun(db.get());
  RunWriter writer(db.get(), run);
  writer.BeginSegment(MakeSegment(db.get()));
  db->SetRunStatus(run, RunStatus::kCrashed, 71, "signal 11");
  const RunInfo info = *db->GetRun(run);
  EXPECT_EQ(info.status, RunStatus::kCrashed);
  EXPECT_EQ(info.exit_code, 71);
  EXPECT_EQ(info.error, "signal 11");
  EXPECT_FALSE(info.ended_utc.empty());
  EXPECT_EQ(db->connection().QueryText("SELECT end_reason FROM segment"), "crashed");
  db->SetRunStatus(run, RunStatus::kQueued);
  EXPECT_TRUE(db->GetRun(run)->ended_utc.empty());
  EXPECT_EQ(ExitCodeOf([&] { db->SetRunStatus(999, RunStatus::kKilled); }), ExitCode::kNotFound);
  for (int i = 0; i < 8; ++i) {
    const auto status = static_cast<RunStatus>(i);
    EXPECT_EQ(ParseRunStatus(RunStatusName(status)), status);
  }
  EXPECT_EQ(ExitCodeOf([] { ParseRunStatus("done"); }, "'done'"), ExitCode::kBadInput);
}

TEST(Database, FiltersTakeListsAndNothingElse) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  for (const char* planner : {"rollout", "mcts_pw"}) {
    for (int seed = 0; seed < 3; ++seed) {
      MakeRun(db.get(), {.planner = planner, .seed = seed});
    }
  }
  MakeRun(db.get(), {.study = "other", .parent_run_id = 1});
  EXPECT_EQ(db->ListRuns().size(), 7u);
  EXPECT_EQ(db->ListRuns({.with_evaluations = false}).size(), 6u);
  EXPECT_EQ(db->ListRuns({.planners = {"rollout"}}).size(), 3u);
  EXPECT_EQ(db->ListRuns({.planners = {"rollout"}, .seeds = {0, 2}}).size(), 2u);
  EXPECT_EQ(db->ListRuns({.studies = {"other"}}).size(), 1u);
  EXPECT_EQ(db->ListRuns({.statuses = {RunStatus::kFinished}}).size(), 0u);
  EXPECT_EQ(db->ListRuns({.tasks = {"' OR 1=1 --"}}).size(), 0u);
}

TEST(Database, NamesAreDataWhateverTheyHold) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  for (const std::string& name :
       {std::string("it's \"quoted\"; DROP TABLE run; --"), std::string("two\nlines\ttab"),
        std::string("../../etc/passwd"), std::string("%s%n"), std::string("\xF0\x9F\xA6\x8A"),
        std::string(10240, 'x'), std::string("back\\slash"), std::string("")}) {
    const std::int64_t run = MakeRun(db.get(), {.study = name, .task = name, .planner = name});
    EXPECT_EQ(db->GetRun(run)->study, name);
    EXPECT_EQ(db->ListRuns({.studies = {name}, .tasks = {name}, .planners = {name}}).size(), 1u)
        << name;
  }
  EXPECT_EQ(db->ListRuns().size(), 8u);
}

TEST(Database, DeletingARunDeletesAllItRecordedAndNothingElse) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  const std::int64_t doomed = MakeRun(db.get());
  const std::int64_t kept = MakeRun(db.get(), {.seed = 1});
  const std::int64_t child = MakeRun(db.get(), {.parent_run_id = doomed});
  for (const std::int64_t run : {doomed, kept, child}) {
    RunWriter writer(db.get(), run);
    writer.BeginSegment(MakeSegment(db.get()));
    writer.AddStep({.env_step = 2});
    writer.AddEpisode({.env_step = 2, .episode_return = 1});
    writer.AddScalar(2, writer.Metric("m"), 1);
    writer.AddTimeUse({2, "other", 1});
    writer.AddEvent(2, "info", "x", "");
    writer.AddArtifact(db->path() + ".files/u/ckpt", "checkpoint", 2, 10, "00");
    writer.Commit();
  }
  db->DeleteRun(doomed);
  EXPECT_EQ(db->ListRuns().size(), 1u);
  for (const char* table :
       {"step", "episode", "scalar", "time_use", "event", "artifact", "curve_bin", "segment"}) {
    EXPECT_EQ(Count(db.get(), std::string("SELECT count(*) FROM ") + table), 1) << table;
    EXPECT_EQ(Count(db.get(), std::string("SELECT run_id FROM ") + table), kept) << table;
  }
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM chunk_digest WHERE run_id = 2"), 3);
  EXPECT_EQ(db->connection().QueryText("SELECT path FROM artifact"), "r.db.files/u/ckpt");
  EXPECT_EQ(ExitCodeOf([&] { db->DeleteRun(doomed); }), ExitCode::kNotFound);
}

TEST(Database, AReplacedRunKeepsItsIdentityAndNothingElse) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  const CreatedRun run = db->CreateRun(MakeNewRun(db.get()));
  {
    RunWriter writer(db.get(), run.run_id);
    writer.BeginSegment(MakeSegment(db.get()));
    writer.AddEpisode({.env_step = 2, .episode_return = 1});
    writer.Commit();
  }
  NewRun changed = MakeNewRun(db.get(), {.config = R"({"other":1})"});
  db->ReplaceRun(run.run_id, changed);
  const RunInfo info = *db->GetRun(run.run_id);
  EXPECT_EQ(info.uuid, run.uuid);
  EXPECT_EQ(info.config_json, R"({"other":1})");
  EXPECT_EQ(info.status, RunStatus::kQueued);
  EXPECT_EQ(info.env_steps_done, 0);
  for (const char* table : {"episode", "curve_bin", "segment", "chunk_digest"}) {
    EXPECT_EQ(Count(db.get(), std::string("SELECT count(*) FROM ") + table), 0) << table;
  }
}

}  // namespace
}  // namespace dreamsearch::results
