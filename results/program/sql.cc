// results sql QUERY - runs a query and prints what it gives.
#include <iostream>

#include "results/database/query.h"
#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"

namespace dreamsearch::results {

int SqlCommand(const Words& words) {
  Arguments arguments(
      "sql", "QUERY [options]",
      "Runs one query, which can change nothing, and prints a table. The tables\n"
      "and views are explained in results/README.md; without a query they are listed.");
  arguments.AddDatabase();
  namespace po = boost::program_options;
  arguments.Add()("format", po::value<std::string>()->default_value("text"),
                  "text, markdown, csv or json")("out", po::value<std::string>()->default_value(""),
                                                 "a file (.txt, .md, .csv, .json)");
  arguments.AddPositional("query");
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);
  const Selection selection = arguments.GetSelection();
  if (selection.databases.size() != 1) throw Failure(ExitCode::kUsage, "sql: expected one --db");
  const auto database = Database::OpenReadOnly(selection.databases.front());
  const std::string query = arguments.Has("query")
                                ? arguments.Get<std::vector<std::string>>("query").front()
                                : "SELECT type, name FROM sqlite_schema WHERE type IN ('table',"
                                  " 'view') AND name NOT LIKE 'sqlite_%' ORDER BY type, name";
  PrintTable(RunQuery(database.get(), query), arguments.Get<std::string>("format"),
             arguments.Get<std::string>("out"));
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch::results
