// results verify - checks stored rows against their digests.
#include <iostream>

#include "results/database/verification.h"
#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/text.h"

namespace dreamsearch::results {

int VerifyCommand(const Words& words) {
  Arguments arguments(
      "verify", "[options]",
      "Checks the file's structure, every stored row against the digest it was written\n"
      "with, and that no decision, episode or segment of a run is missing. Exits 78 if\n"
      "anything does not fit. `runner verify` repeats a run.");
  arguments.AddDatabase();
  arguments.AddFilter();
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);
  const Selection selection = arguments.GetSelection();
  std::size_t problems = 0;
  for (const auto& database : OpenSelected(selection)) {
    const std::vector<std::string> found = Verify(database.get(), selection.filter);
    for (const std::string& problem : found) {
      std::cout << database->path() << ": " << Printable(problem) << "\n";
    }
    if (found.empty()) {
      std::cout << database->path() << ": "
                << GroupDigits(
                       static_cast<std::int64_t>(database->ListRuns(selection.filter).size()))
                << " runs are as they were written\n";
    }
    problems += found.size();
  }
  return static_cast<int>(problems == 0 ? ExitCode::kOk : ExitCode::kVerificationFailed);
}

}  // namespace dreamsearch::results
