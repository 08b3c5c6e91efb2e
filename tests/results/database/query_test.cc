// What other people's SQL may do: read, and nothing else; and where its answer goes.
#include "results/database/query.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <stdexcept>

#include "results/system/error.h"
#include "results/system/file.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

class QueryTest : public testing::Test {
 protected:
  QueryTest() {
    MakeRun(Database::OpenOrCreate(folder_ / "r.db").get(), {});
    db_ = Database::OpenReadOnly(folder_ / "r.db");
  }
  std::string Csv(const std::string& sql) {
    return RunQuery(db_.get(), sql).Print(TableForm::kCsv);
  }

  TemporaryFolder folder_;
  std::unique_ptr<Database> db_;
};

TEST_F(QueryTest, ReadsTablesViewsFunctionsAndJson) {
  EXPECT_NE(Csv("SELECT count(*) AS n FROM run JOIN v_run USING (run_id)").find('1'),
            std::string::npos);
  EXPECT_NE(Csv("SELECT value FROM json_each('[5]')").find('5'), std::string::npos);
  EXPECT_NE(Csv("SELECT j.key AS key FROM config c, json_each(c.json) j").find("key"),
            std::string::npos);
  EXPECT_NE(Csv("/* a comment */ WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n"
                " WHERE i < 9) SELECT sum(i) AS total FROM n")
                .find("45"),
            std::string::npos);
}

TEST_F(QueryTest, AFunctionOfOursGivesTextAndItsFailureIsTheQuerys) {
  db_->connection().AddFunction("shout", [](const std::string& text) {
    if (text == "quiet") throw std::runtime_error("not in here");
    return text + "!";
  });
  EXPECT_EQ(Csv("SELECT shout('a') AS a, shout(NULL) IS NULL AS b, sha256('') AS c"),
            "a,b,c\na!,1,e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855\n");
  try {
    Csv("SELECT shout('quiet')");
    FAIL() << "expected a Failure";
  } catch (const Failure& error) {
    EXPECT_NE(std::string(error.what()).find("not in here"), std::string::npos) << error.what();
  }
}

TEST_F(QueryTest, HasTheStandardErrorOfAMean) {
  // 1, 2, 3, 4: variance 5 / 3, of the mean 5 / 12. Far from 0 no digits are lost.
  EXPECT_EQ(Csv("WITH g(k, x) AS (VALUES (1, 1), (1, 2), (1, NULL), (1, 3), (1, 4), (2, 7),"
                " (3, 1e9 + 1), (3, 1e9 + 3), (4, NULL))"
                " SELECT k, round(standard_error(x), 6) AS error FROM g GROUP BY k"),
            "k,error\n1,0.645497\n2,\n3,1\n4,\n");
}

TEST_F(QueryTest, ChangesNothing) {
  for (const char* sql :
       {"DELETE FROM run", "UPDATE run SET seed = 9", "INSERT INTO study (name) VALUES ('x')",
        "DROP TABLE run", "CREATE TABLE x (y)", "UPDATE sqlite_master SET name = 'x'",
        "DELETE FROM sqlite_master", "ATTACH 'x.db' AS x", "PRAGMA query_only = OFF", "VACUUM",
        "BEGIN", "SELECT 1; DELETE FROM run", "SELECT", ""}) {
    EXPECT_THROW(Csv(sql), Failure) << sql;
    // Nor does a refused query leave anything behind that lets the next one through.
    Csv("SELECT value FROM json_each('[5]')");
  }
  EXPECT_NE(Csv("SELECT count(*) AS n FROM run WHERE seed <> 9").find('1'), std::string::npos);
}

TEST_F(QueryTest, MakesNoFile) {
  const std::string out = folder_ / "out.db";
  for (const std::string& sql : {"VACUUM INTO '" + out + "'", "ATTACH '" + out + "' AS o"}) {
    EXPECT_THROW(Csv(sql), Failure) << sql;
    EXPECT_FALSE(std::filesystem::exists(out)) << sql;
  }
}

TEST_F(QueryTest, AnErrorWhileItRunsIsTheQuerysAndNotADefect) {
  for (const char* sql :
       {"SELECT abs(-9223372036854775808)", "SELECT json('[')", "SELECT zeroblob(99999999999)",
        "SELECT sum(i) FROM (SELECT"
        " 9223372036854775807 AS i UNION ALL SELECT 1)"}) {
    try {
      Csv(sql);
      FAIL() << sql;
    } catch (const Failure& error) {
      EXPECT_EQ(error.code(), ExitCode::kUsage) << sql << ": " << error.what();
    }
  }
}

TEST_F(QueryTest, ATextIsNoFormulaInASpreadsheet) {
  const auto cell = [&](const std::string& value) {
    const std::string csv = Csv("SELECT " + value + " AS x");
    return csv.substr(2, csv.size() - 3);
  };
  EXPECT_EQ(cell("'=1+1'"), "'=1+1");
  EXPECT_EQ(cell("'@SUM(A1)'"), "'@SUM(A1)");
  EXPECT_EQ(cell("'+cmd|x'"), "'+cmd|x");
  EXPECT_EQ(cell("'-2+3'"), "'-2+3");
  // Numbers are numbers, as text too.
  EXPECT_EQ(cell("-1.5"), "-1.5");
  EXPECT_EQ(cell("'-1.5'"), "-1.5");
  EXPECT_EQ(cell("'walker-walk'"), "walker-walk");
}

// An object of JSON has room for one value of a name.
TEST_F(QueryTest, ColumnsOfOneNameAreBothPrintedOrRefused) {
  const Table table = RunQuery(
      db_.get(),
      "SELECT r.run_id, s.name, t.name FROM run r JOIN study s USING (study_id) JOIN task t"
      " USING (task_id)");
  EXPECT_EQ(table.Print(TableForm::kCsv), "run_id,name,name\n1,default,walker_walk\n");
  for (const TableForm form : {TableForm::kText, TableForm::kMarkdown}) {
    EXPECT_NE(table.Print(form).find("default"), std::string::npos);
    EXPECT_NE(table.Print(form).find("walker_walk"), std::string::npos);
  }
  for (const char* sql :
       {"SELECT s.name, t.name FROM study s, task t", "SELECT * FROM v_run a, v_run b",
        "SELECT 1 AS x, 2 AS x", "SELECT * FROM run JOIN study USING (study_id), task"}) {
    try {
      RunQuery(db_.get(), sql).Print(TableForm::kJson);
      FAIL() << sql;
    } catch (const Failure& error) {
      EXPECT_EQ(error.code(), ExitCode::kUsage);
      EXPECT_NE(std::string(error.what()).find(" AS "), std::string::npos) << error.what();
    }
  }
  EXPECT_NE(RunQuery(db_.get(), "SELECT s.name AS study, t.name AS task FROM study s, task t")
                .Print(TableForm::kJson)
                .find("\"study\": \"default\""),
            std::string::npos);
}

TEST(OutputFile, WritesWhereALinkPointsAndLeavesTheLink) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "sub");
  std::filesystem::create_symlink("sub/second", folder / "first");
  std::filesystem::create_symlink("../target", folder / "sub/second");
  for (const char* text : {"into nothing", "over the old"}) {
    WriteFile(folder / "first", text);
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "first"));
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "sub/second"));
    EXPECT_FALSE(std::filesystem::is_symlink(folder / "target"));
    EXPECT_EQ(ReadWholeFile(folder / "target"), text);
  }
  std::filesystem::create_symlink("loop", folder / "loop");
  EXPECT_THROW(WriteFile(folder / "loop", "x"), Failure);
}

TEST(OutputFile, WritesIntoWhatIsNoRegularFile) {
  const TemporaryFolder folder;
  const std::string fifo = folder / "pipe";
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  const int reader = open(fifo.c_str(), O_RDONLY | O_NONBLOCK);
  WriteFile(fifo, "through");
  char text[16] = {};
  EXPECT_EQ(read(reader, text, sizeof text - 1), 7);
  close(reader);
  EXPECT_STREQ(text, "through");
  EXPECT_TRUE(std::filesystem::is_fifo(fifo));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

}  // namespace
}  // namespace dreamsearch::results
