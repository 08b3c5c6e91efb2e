// results import - published curves, to be drawn beside ours.
#include <iostream>
#include <set>

#include "results/analysis/published.h"
#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

// "hopper_hop, humanoid_run": tasks that no run of the database is of, and so no
// figure; nothing for a database without runs.
std::string UnknownTasks(Database* database, const std::vector<PublishedPoint>& points) {
  constexpr std::size_t kShown = 5;
  std::set<std::string> known, unknown;
  Statement rows = database->connection().Prepare("SELECT name FROM task");
  while (rows.Step()) known.insert(rows.Text(0));
  for (const PublishedPoint& point : points) {
    if (known.count(point.task) == 0) unknown.insert(point.task);
  }
  if (known.empty()) return "";
  std::string text;
  std::size_t shown = 0;
  for (const std::string& task : unknown) {
    if (shown++ == kShown)
      return text + " and " + std::to_string(unknown.size() - kShown) + " more";
    text += (text.empty() ? "" : ", ") + Printable(task);
  }
  return text;
}

}  // namespace

int ImportCommand(const Words& words) {
  Arguments arguments(
      "import", "FILE... [options]",
      "Reads published learning curves into the table `published`. Three formats are known: a\n"
      "CSV of scores (source, method, obs, task, env_steps, seed, return), Dreamer's JSON lists\n"
      "({task, method, seed, xs, ys}) and TD-MPC2's CSV a task (step,reward,seed; the file's name\n"
      "is the task and the folder's the method). `results curves --published` draws them.");
  arguments.AddDatabase();
  namespace po = boost::program_options;
  const auto text = [] { return po::value<std::string>()->default_value("")->value_name("NAME"); };
  arguments.Add()("format", text(), "scores, dreamer or tdmpc2; otherwise told by the content")(
      "source", text(), "who published it, where the file does not say or to override it")(
      "method", text(), "the method")("obs", text(), "state or pixels")("task", text(), "the task")(
      "steps-per-unit", po::value<std::string>()->default_value("1")->value_name("N"),
      "environment steps in one unit of the file's steps");
  arguments.AddPositional("file", true);
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);
  if (!arguments.Has("file")) throw Failure(ExitCode::kUsage, "import: expected files, found none");
  const Selection selection = arguments.GetSelection();
  if (selection.databases.size() != 1) throw Failure(ExitCode::kUsage, "import: expected one --db");
  const ImportSettings settings = {
      .format = arguments.Get<std::string>("format"),
      .source = arguments.Get<std::string>("source"),
      .method = arguments.Get<std::string>("method"),
      .obs = arguments.Get<std::string>("obs"),
      .task = arguments.Get<std::string>("task"),
      .steps_per_unit =
          ParseNumber(arguments.Get<std::string>("steps-per-unit"), "--steps-per-unit", 1)};
  // All files are read before anything is written.
  std::vector<std::pair<std::string, std::vector<PublishedPoint>>> files;
  for (const std::string& file : arguments.Get<std::vector<std::string>>("file")) {
    files.emplace_back(file, ParsePublished(file, ReadWholeFile(file), settings));
  }
  const auto database = Database::OpenOrCreate(selection.databases.front());
  for (const auto& [file, points] : files) {
    StorePublished(database.get(), points);
    const std::string unknown = UnknownTasks(database.get(), points);
    if (!unknown.empty()) {
      std::cerr << "note: " << AbsolutePath(file) << ": no run here is of " << unknown << "\n";
    }
    std::cout << AbsolutePath(file) << ": " << GroupDigits(static_cast<std::int64_t>(points.size()))
              << " points\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch::results
