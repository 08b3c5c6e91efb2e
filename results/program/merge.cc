// results merge - how do the runs of several machines come into one database?
#include "results/upkeep/merge.h"

#include <sys/resource.h>

#include <iostream>
#include <memory>
#include <vector>

#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/text.h"

namespace dreamsearch::results {

namespace {

// A database takes three descriptors, and others are needed as well.
std::size_t MostOpen() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_NOFILE, &limit) == 0 ? static_cast<std::size_t>(limit.rlim_cur) / 4 : 0;
}

struct MergeDatabases {
  std::string db = kDefaultDatabase;
  std::vector<std::string> sources;
  bool without_decisions = false;

  CommandSpec Declare() {
    return {
        .name = "results merge",
        .summary = "adds the runs of several databases to one",
        .usage = {"results merge SOURCE... --db TARGET"},
        .examples = {"results merge node1.db node2.db --db all.db",
                     "results merge results/dreamsearch.db --db small.db --without-decisions"},
        .about =
            "Creates the target if it does not exist. If both have a run, the one that got "
            "further stays, so the order of merging makes no difference.",
        .arguments = {{"", "SOURCE", Texts(&sources).Required(), "the databases to read"}},
        .groups = {{"Where to", {{"db", "TARGET", Text(&db), "the database to add to"}}},
                   {"How much",
                    {{"without-decisions", "", Switch(&without_decisions),
                      "leave the rows of single decisions of finished runs out, most of a "
                      "database: curves, comparisons and `results verify` do not need them"}}}}};
  }
  int Run();
};

int MergeDatabases::Run() {
  // Before anything is written. As many stay open as descriptors allow.
  std::vector<std::unique_ptr<Database>> opened;
  for (const std::string& source : sources) {
    opened.push_back(Database::OpenReadOnly(source));
    if (opened.size() > MostOpen()) opened.back().reset();
  }
  const auto target = Database::OpenOrCreate(db);
  for (const std::string& warning : target->warnings()) std::cerr << "warning: " << warning << "\n";
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string& source = sources[i];
    if (opened[i] == nullptr) opened[i] = Database::OpenReadOnly(source);
    const MergeResult result =
        Merge(target.get(), opened[i].get(), {.decisions = !without_decisions});
    opened[i].reset();
    for (const std::string& note : result.notes) std::cerr << "note: " << Printable(note) << "\n";
    std::cout << AbsolutePath(source) << ": " << result.added << " runs added, " << result.replaced
              << " replaced, " << result.kept << " kept as they were; " << GroupDigits(result.rows)
              << " rows\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command MergeCommand() { return MakeCommand<MergeDatabases>(); }

}  // namespace dreamsearch::results
