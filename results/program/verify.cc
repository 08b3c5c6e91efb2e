// results verify - is every stored row what was written?
#include <iostream>

#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/text/text.h"
#include "results/upkeep/verification.h"

namespace dreamsearch::results {

namespace {

struct VerifyRows {
  Selection selection;

  CommandSpec Declare() {
    return {.name = "results verify",
            .summary = "checks every stored row against its digest",
            .examples = {"results verify --db walker.db"},
            .about =
                "Checks the structure of the file, every stored row against the digest that "
                "was written with it, and that no decision, episode or segment of a run is "
                "missing. The exit status is 78 if something does not fit. `runner verify` "
                "repeats a run.",
            .groups = {SelectionFlags(&selection)}};
  }
  int Run();
};

int VerifyRows::Run() {
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

}  // namespace

Command VerifyCommand() { return MakeCommand<VerifyRows>(); }

}  // namespace dreamsearch::results
