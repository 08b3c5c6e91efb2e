// results - reads, compares, draws, merges and checks results databases.
#include <string>

#include "results/command_line/database_flag.h"
#include "results/command_line/program.h"
#include "results/program/commands.h"

namespace dreamsearch::results {
namespace {

Program Results() {
  CommandSpec spec = {
      .name = "results",
      .summary = "reads, compares, draws, merges and checks the databases that `runner` writes",
      .usage = {"results COMMAND [arguments]"},
      .examples = {"results list", "results curves --out curves.svg",
                   "results report report.html --study first"},
      .about = std::string("Every command reads ") + kDefaultDatabase +
               " unless --db names another file."};
  return {.version = "results " DREAMSEARCH_PROJECT_VERSION,
          .root = {std::move(spec), nullptr},
          .commands = {ListCommand(), ShowCommand(), CurvesCommand(), CompareCommand(),
                       ReportCommand(), ExportCommand(), ImportCommand(), MergeCommand(),
                       VerifyCommand(), DeleteCommand(), SqlCommand()}};
}

}  // namespace
}  // namespace dreamsearch::results

int main(int argc, char** argv) {
  return dreamsearch::ExitStatusOf("results", [&] {
    return dreamsearch::RunProgram(dreamsearch::results::Results(),
                                   {argv + (argc > 0), argv + argc});
  });
}
