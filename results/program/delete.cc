// results delete - deletes runs and all they recorded.
#include <algorithm>
#include <filesystem>
#include <iostream>

#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/text.h"

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
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);
  const Selection selection = arguments.GetSelection();
  const RunFilter& filter = selection.filter;
  const bool chosen = !filter.studies.empty() || !filter.tasks.empty() ||
                      !filter.planners.empty() || !filter.seeds.empty() || !filter.statuses.empty();
  if (selection.databases.size() != 1) throw Failure(ExitCode::kUsage, "delete: expected one --db");
  if (arguments.Has("run") == chosen) {
    throw Failure(ExitCode::kUsage,
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
  // What goes with them.
  const std::size_t named = runs.size();
  for (RunInfo& run : database->ListRuns()) {
    const auto is = [](std::int64_t run_id) {
      return [run_id](const RunInfo& other) { return other.run_id == run_id; };
    };
    if (!run.parent_run_id || std::any_of(runs.begin(), runs.end(), is(run.run_id)) ||
        std::none_of(runs.begin(), runs.end(), is(*run.parent_run_id))) {
      continue;
    }
    runs.push_back(std::move(run));
  }
  for (const RunInfo& run : runs) {
    if (!IsActive(run)) continue;
    throw Failure(ExitCode::kUsage,
                  database->path() + ": run " + std::to_string(run.run_id) +
                      (run.parent_run_id
                           ? ", an evaluation of run " + std::to_string(*run.parent_run_id) + ","
                           : "") +
                      " is running; stop it first. Nothing was deleted.");
  }
  const bool yes = arguments.Has("yes");
  for (const RunInfo& run : runs) {
    // It may have gone with a run it evaluates.
    if (yes && database->GetRun(run.run_id)) database->DeleteRun(run.run_id);
    std::cout << (yes ? "deleted" : "would delete") << " run " << run.run_id << "  "
              << run.uuid.substr(0, 8) << "  " << Printable(run.study) << "  "
              << Printable(run.task) << "  " << Printable(run.planner) << "  seed " << run.seed
              << "  " << RunStatusName(run.status);
    if (run.parent_run_id) std::cout << "  evaluation of run " << *run.parent_run_id;
    std::cout << "\n";
    if (yes && arguments.Has("files") && IsUuid(run.uuid)) {
      std::error_code error;
      const std::string folder = database->RunFolder(run);
      if (folder == database->path() + ".files/" + run.uuid) {
        std::filesystem::remove_all(folder, error);
      } else if (std::filesystem::exists(folder, error)) {
        std::cerr << "kept " << folder << ": it belongs to the database it was merged from\n";
      }
      if (error) std::cerr << "warning: " << folder << ": " << error.message() << "\n";
    }
  }
  if (runs.size() > named) {
    std::cerr << runs.size() << " runs, " << runs.size() - named
              << " of them evaluations that go with the run they are of\n";
  }
  if (!yes) std::cerr << "nothing was deleted; --yes deletes\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch::results
