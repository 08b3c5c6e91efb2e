// results merge - the runs of several databases in one.
#include "results/database/merge.h"

#include <iostream>

#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/text.h"

namespace dreamsearch::results {

int MergeCommand(const Words& words) {
  Arguments arguments(
      "merge", "--db TARGET SOURCE... [options]",
      "Adds the runs of the sources to the target, which is made if it is not there. A run that\n"
      "both have stays as the one that got further; the order of merging makes no difference.");
  arguments.AddDatabase();
  arguments.AddPositional("source", true);
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);
  const Selection selection = arguments.GetSelection();
  if (selection.databases.size() != 1) throw Failure(ExitCode::kUsage, "merge: expected one --db");
  if (!arguments.Has("source")) {
    throw Failure(ExitCode::kUsage, "merge: expected databases to merge, found none");
  }
  const auto sources = arguments.Get<std::vector<std::string>>("source");
  // Before anything is written.
  for (const std::string& source : sources) Database::OpenReadOnly(source);
  const auto target = Database::OpenOrCreate(selection.databases.front());
  for (const std::string& warning : target->warnings()) std::cerr << "warning: " << warning << "\n";
  for (const std::string& source : sources) {
    const MergeResult result = Merge(target.get(), source);
    for (const std::string& note : result.notes) std::cerr << "note: " << Printable(note) << "\n";
    std::cout << AbsolutePath(source) << ": " << result.added << " runs added, " << result.replaced
              << " replaced, " << result.kept << " kept as they were; " << GroupDigits(result.rows)
              << " rows\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch::results
