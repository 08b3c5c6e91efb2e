// results delete - deletes runs and all they recorded.
#include <filesystem>
#include <iostream>

#include "results/program/arguments.h"
#include "results/program/commands.h"

namespace dreamsearch::results {
namespace {

bool IsUuid(const std::string& text) {
  return text.size() == 36 && text.find_first_not_of("0123456789abcdef-") == std::string::npos;
}

}  // namespace

int DeleteCommand(const Words& words) {
  Arguments arguments(
      "delete", "[RUN...] [options]",
      "Deletes runs, named or chosen by --study, --env, --planner, --seed and --status, with all\n"
      "they recorded and the evaluations of them. Without --yes it only says what it would "
      "delete.");
  arguments.AddDatabase();
  arguments.AddFilter();
  namespace po = boost::program_options;
  arguments.Add()("status", po::value<std::vector<std::string>>()->value_name("LIST"),
                  "only runs of these statuses")("yes", "do it")(
      "files", "delete the runs' checkpoints and logs as well");
  arguments.AddPositional("run", true);
  if (!arguments.Parse(words)) return kExitOk;
  Selection selection = arguments.GetSelection();
  for (const std::string& status : arguments.List("status")) {
    selection.filter.statuses.push_back(ParseRunStatus(status));
  }
  const RunFilter& filter = selection.filter;
  const bool chosen = !filter.studies.empty() || !filter.tasks.empty() ||
                      !filter.planners.empty() || !filter.seeds.empty() || !filter.statuses.empty();
  if (selection.databases.size() != 1) throw Error(kExitUsage, "delete: expected one --db");
  if (arguments.Has("run") == chosen) {
    throw Error(kExitUsage,
                "delete: expected either runs or a choice by --study, --env, --planner, "
                "--seed or --status");
  }
  OpenSelected(selection);  // every name asked for must be there
  const auto database = Database::OpenExisting(selection.databases.front());
  std::vector<RunInfo> runs;
  if (chosen) {
    runs = database->ListRuns(filter);
  } else {
    for (const std::string& name : arguments.Get<std::vector<std::string>>("run")) {
      runs.push_back(database->GetRun(name));
    }
  }
  for (const RunInfo& run : runs) {
    if (IsActive(run)) {
      throw Error(kExitUsage, database->path() + ": run " + std::to_string(run.run_id) +
                                  " is running; stop it first. Nothing was deleted.");
    }
  }
  const bool yes = arguments.Has("yes");
  for (const RunInfo& run : runs) {
    std::cout << (yes ? "deleted" : "would delete") << " run " << run.run_id << "  "
              << run.uuid.substr(0, 8) << "  " << Printable(run.study) << "  "
              << Printable(run.task) << "  " << Printable(run.planner) << "  seed " << run.seed
              << "  " << RunStatusName(run.status) << "\n";
    if (!yes) continue;
    // It may have gone with a run it evaluated.
    if (database->GetRun(run.run_id)) database->DeleteRun(run.run_id);
    if (arguments.Has("files") && IsUuid(run.uuid)) {
      std::error_code error;
      const std::string folder = database->RunFolder(run);
      std::filesystem::remove_all(folder, error);
      if (error) std::cerr << "warning: " << folder << ": " << error.message() << "\n";
    }
  }
  if (!yes) std::cerr << "nothing was deleted; --yes deletes\n";
  return kExitOk;
}

}  // namespace dreamsearch::results
