// Databases rebuilt from SQL text, as `sqlite3 a.db .dump | sqlite3 b.db` does: they lose
// application_id and user_version, and nothing else.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "results/database/schema.h"
#include "results/system/error.h"
#include "results/text/shell.h"
#include "results/text/text.h"
#include "results/upkeep/verification.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

class RebuiltDatabase : public testing::Test {
 protected:
  void SetUp() override {
    const auto db = Database::OpenOrCreate(folder_ / "a.db");
    RunWriter writer(db.get(), MakeRun(db.get(), {.study = "it's"}));
    writer.BeginSegment(MakeSegment(db.get()));
    for (std::int64_t i = 1; i <= 2000; ++i) {
      writer.AddStep({.env_step = i, .t = i - 1, .reward = 1.0 / static_cast<double>(3 * i)});
    }
    writer.AddEpisode({.env_step = 2000, .length = 2000, .episode_return = 1.0 / 7});
    writer.SetProgress(2000);
    writer.Finish();
    db->SetRunStatus(1, RunStatus::kFinished, 0);
    db->connection().Execute("CREATE VIEW mine AS SELECT 7 AS seven");
  }
  void Dump(const std::string& from, const std::string& to, const std::string& filter = "cat") {
    ASSERT_EQ(std::system(("sqlite3 " + ShellWord(folder_ / from) + " .dump 2>/dev/null | " +
                           filter + " | sqlite3 " + ShellWord(folder_ / to) + " 2>/dev/null")
                              .c_str()),
              0);
  }
  static std::string What(const std::function<void()>& call, ExitCode code) {
    try {
      call();
    } catch (const Failure& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      return error.what();
    }
    ADD_FAILURE() << "no failure";
    return "";
  }

  TemporaryFolder folder_;
};

TEST_F(RebuiltDatabase, IsRecognisedByItsTablesAndHasEveryRow) {
  for (const bool reading : {true, false}) {
    const std::string name = reading ? "r.db" : "w.db";
    Dump("a.db", name);
    const auto db =
        reading ? Database::OpenReadOnly(folder_ / name) : Database::OpenOrCreate(folder_ / name);
    EXPECT_EQ(Count(db.get(), "PRAGMA application_id"), kApplicationId);
    EXPECT_EQ(Count(db.get(), "PRAGMA user_version"), SchemaVersion());
    EXPECT_EQ(db->GetRun(1)->study, "it's");
    EXPECT_TRUE(Verify(db.get(), {}).empty());
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM step"), 2000);
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM v_curve"), 1);
    EXPECT_EQ(Count(db.get(), "SELECT seven FROM mine"), 7);
  }
}

TEST_F(RebuiltDatabase, OfAnOlderSchemaIsBroughtUpToDate) {
  for (std::size_t version = 1; version <= Migrations().size(); ++version) {
    const std::string path = folder_ / ("old" + std::to_string(version) + ".db");
    {
      Connection old(path, OpenMode::kCreate);
      for (std::size_t v = 0; v < version; ++v) old.Execute(Migrations()[v]);
      old.Execute("INSERT INTO study (name, description, created_utc) VALUES ('kept', '', 'then')");
    }
    const auto db = Database::OpenReadOnly(path);
    EXPECT_EQ(Count(db.get(), "PRAGMA user_version"), SchemaVersion());
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM study WHERE name = 'kept'"), 1);
    EXPECT_NE(db->connection()
                  .QueryText("SELECT sql FROM sqlite_schema WHERE name ="
                             " 'chunk_digest'")
                  .find("'run'"),
              std::string::npos);
  }
}

TEST_F(RebuiltDatabase, OfAnotherProgramIsStillRefused) {
  const std::string path = folder_ / "other.db";
  Connection(path, OpenMode::kCreate)
      .Execute("CREATE TABLE run (x); CREATE TABLE study (y); CREATE TABLE episode (z)");
  for (int i = 0; i < 2; ++i) {
    What([&] { Database::OpenReadOnly(path); }, ExitCode::kBadInput);
    What([&] { Database::OpenOrCreate(path); }, ExitCode::kBadInput);
  }
  Connection here(path, OpenMode::kReadOnly);
  EXPECT_EQ(here.QueryInt("PRAGMA application_id"), 0);
  EXPECT_EQ(here.QueryInt("PRAGMA user_version"), 0);
}

// Tables like ours under another program's mark are that program's.
TEST_F(RebuiltDatabase, MarkedByAnotherProgramIsRefusedByReadersAndWriters) {
  Database::OpenOrCreate(folder_ / "m.db")->connection().Execute("PRAGMA application_id = 7");
  for (const auto open : {Database::OpenReadOnly, Database::OpenExisting}) {
    try {
      open(folder_ / "m.db");
      FAIL();
    } catch (const Failure& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput) << error.what();
    }
  }
  Connection(folder_ / "m.db", OpenMode::kReadWrite).Execute("PRAGMA application_id = 0");
  EXPECT_EQ(Database::OpenReadOnly(folder_ / "m.db")->ListRuns().size(), 0u);
}

TEST_F(RebuiltDatabase, WithASchemaBelowZeroIsRefused) {
  for (const char* version : {"-1", "-5", "-2147483648"}) {
    Connection(folder_ / "a.db", OpenMode::kReadWrite)
        .Execute(std::string("PRAGMA user_version = ") + version);
    for (int i = 0; i < 2; ++i) {
      EXPECT_NE(What([&] { Database::OpenReadOnly(folder_ / "a.db"); }, ExitCode::kBadInput)
                    .find(version),
                std::string::npos);
      What([&] { Database::OpenOrCreate(folder_ / "a.db"); }, ExitCode::kBadInput);
    }
  }
}

// Pasted, the command of the message saves what can be read, with this machine's sqlite3.
TEST_F(RebuiltDatabase, TheAdviceForADamagedFileWorks) {
  Connection(folder_ / "a.db", OpenMode::kReadWrite)
      .Execute("PRAGMA wal_checkpoint(TRUNCATE); PRAGMA journal_mode = delete");
  const std::string name = folder_ / "it's damaged.db";
  std::filesystem::copy_file(folder_ / "a.db", name);
  const std::int64_t page =
      Connection(name, OpenMode::kReadOnly)
          .QueryInt(
              "SELECT pageno FROM dbstat WHERE name = 'step' AND pagetype = 'leaf' ORDER BY"
              " pageno LIMIT 1 OFFSET 3")
          .value();
  std::fstream file(name, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp((page - 1) * 4096);
  file << std::string(4096, '\xff');
  file.close();
  const std::string message =
      What([&] { Count(Database::OpenReadOnly(name).get(), "SELECT sum(reward) FROM step"); },
           ExitCode::kBadInput);
  const std::size_t from = message.find("sqlite3 ");
  ASSERT_NE(from, std::string::npos) << message;
  std::system((message.substr(from) + " 2>/dev/null").c_str());
  const auto saved = Database::OpenReadOnly(name + ".saved");
  EXPECT_EQ(saved->GetRun(1)->study, "it's");
  EXPECT_EQ(Count(saved.get(), "SELECT count(*) FROM episode"), 1);
  EXPECT_GT(Count(saved.get(), "SELECT count(*) FROM step"), 0);
}

}  // namespace
}  // namespace dreamsearch::results
