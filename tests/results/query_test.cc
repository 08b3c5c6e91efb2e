// What other people's SQL may do: read, and nothing else.
#include "results/query.h"

#include <gtest/gtest.h>

#include "recording.h"
#include "results/error.h"

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
  EXPECT_NE(Csv("SELECT count(*) AS n FROM run JOIN v_run USING (run_id)").find("1"),
            std::string::npos);
  EXPECT_NE(Csv("SELECT value FROM json_each('[5]')").find("5"), std::string::npos);
  EXPECT_NE(Csv("SELECT j.key AS key FROM config c, json_each(c.json) j").find("key"),
            std::string::npos);
  EXPECT_NE(Csv("/* a comment */ WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n"
                " WHERE i < 9) SELECT sum(i) AS total FROM n")
                .find("45"),
            std::string::npos);
}

TEST_F(QueryTest, ChangesNothing) {
  for (const char* sql :
       {"DELETE FROM run", "UPDATE run SET seed = 9", "INSERT INTO study (name) VALUES ('x')",
        "DROP TABLE run", "CREATE TABLE x (y)", "UPDATE sqlite_master SET name = 'x'",
        "DELETE FROM sqlite_master", "ATTACH 'x.db' AS x", "PRAGMA query_only = OFF", "VACUUM",
        "BEGIN", "SELECT 1; DELETE FROM run", "SELECT", ""}) {
    EXPECT_THROW(Csv(sql), Error) << sql;
    // Nor does a refused query leave anything behind that lets the next one through.
    Csv("SELECT value FROM json_each('[5]')");
  }
  EXPECT_NE(Csv("SELECT count(*) AS n FROM run WHERE seed <> 9").find("1"), std::string::npos);
}

}  // namespace
}  // namespace dreamsearch::results
