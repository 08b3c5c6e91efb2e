#include <algorithm>
#include <iomanip>
#include <iostream>

#include "host/commands/commands.h"
#include "host/commands/options.h"
#include "host/commands/progress.h"
#include "host/processes/worker.h"
#include "results/database/database.h"
#include "results/system/error.h"
#include "results/system/text.h"

namespace dreamsearch {

namespace po = boost::program_options;

int StatusCommand(const std::vector<std::string>& arguments) {
  std::string db = "results/dreamsearch.db";
  po::options_description flags(
      "runner status [--db FILE]\n\nWhat is queued, active, stopped and "
      "done in a results database");
  flags.add_options()("help", "show this help")(
      "db", po::value<std::string>(&db)->default_value(db), "results database");
  const po::variables_map given = ParseFlags("runner status", arguments, flags);
  if (given.count("help") != 0) {
    std::cout << flags;
    return 0;
  }
  const auto database = results::Database::OpenReadOnly(db);
  const std::vector<results::RunInfo> runs = database->ListRuns();
  if (runs.empty()) {
    std::cout << "no runs in " << database->path() << "\n";
    return 0;
  }
  std::size_t label_width = 0;
  const bool models_differ = std::any_of(
      runs.begin(), runs.end(), [&](const auto& run) { return run.model != runs.front().model; });
  const auto label = [&](const results::RunInfo& run) {
    std::string text = run.task + " " + run.planner;
    if (models_differ) text += " on " + run.model;
    text += " seed " + std::to_string(run.seed);
    if (run.parent_run_id) text += ", evaluation of " + std::to_string(*run.parent_run_id);
    return text;
  };
  for (const results::RunInfo& run : runs) label_width = std::max(label_width, label(run).size());
  for (const results::RunInfo& run : runs) {
    const bool held = RunIsLocked(database->RunFolder(run));
    std::string state = results::RunStatusName(run.status);
    // A run that says it is running but that nobody holds lost its process.
    if (run.status == results::RunStatus::kRunning && !held) state = "stale";
    std::cout << std::setw(4) << run.run_id << "  " << std::left
              << std::setw(static_cast<int>(label_width)) << label(run) << "  " << std::setw(11)
              << state << std::right << "  " << std::setw(11)
              << GroupDigits(static_cast<std::uint64_t>(run.env_steps_done)) << " of "
              << GroupDigits(static_cast<std::uint64_t>(run.env_steps_target)) << " steps";
    if (held) std::cout << "  seen " << FormatDuration(run.heartbeat_age_seconds) << " ago";
    if (!run.error.empty()) std::cout << "  " << run.error;
    std::cout << "\n";
  }
  return 0;
}

}  // namespace dreamsearch
