// results sql QUERY - what does the database say to a question of your own?
#include <iostream>

#include "results/database/query.h"
#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"

namespace dreamsearch::results {

namespace {

struct Sql {
  std::string query, db = kDefaultDatabase, out;
  TableForm form = TableForm::kText;

  CommandSpec Declare() {
    return {.name = "results sql",
            .summary = "runs a query and prints the table it gives",
            .examples = {"results sql \"SELECT task, planner, count(*) FROM v_run GROUP BY 1, 2\""},
            .about =
                "The query can change nothing. results/README.md explains the tables and "
                "views; without a query the command lists them. Beside SQLite's functions "
                "there is standard_error(x), of the mean of a group.",
            .arguments = {{"", "QUERY", Text(&query), "one SELECT"}},
            .groups = {{"Where", {DatabaseFlag(&db)}},
                       {"How",
                        {FormFlag(&form),
                         {"out", "FILE", Text(&out),
                          "write the table to this file (.txt, .md, .csv, .json)"}}}}};
  }
  int Run();
};

int Sql::Run() {
  const auto database = Database::OpenReadOnly(db);
  if (query.empty()) {
    query =
        "SELECT type, name FROM sqlite_schema WHERE type IN ('table', 'view') AND name NOT LIKE"
        " 'sqlite_%' ORDER BY type, name";
  }
  PrintTable(RunQuery(database.get(), query), form, out);
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command SqlCommand() { return MakeCommand<Sql>(); }

}  // namespace dreamsearch::results
