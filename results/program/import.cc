// results import - how do we compare with what others have published?
#include <algorithm>
#include <iostream>
#include <set>

#include "results/analysis/published.h"
#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/text.h"

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

struct Import {
  std::vector<std::string> files;
  std::string db = kDefaultDatabase;
  ImportSettings settings;

  CommandSpec Declare() {
    return {
        .name = "results import",
        .summary = "reads published learning curves, to be drawn beside ours",
        .examples = {"results import scores.csv", "results curves --published all"},
        .about =
            "Reads the files into the table `published`. It knows three formats: a CSV of "
            "scores (source, method, obs, task, env_steps, seed, return), Dreamer's JSON "
            "lists ({task, method, seed, xs, ys}) and TD-MPC2's CSV of a task "
            "(step,reward,seed; the file's name is the task, the folder's name the method). "
            "Files may be packed with gzip.",
        .arguments = {{"", "FILE", Texts(&files).Required(), "the files to read"}},
        .groups = {
            {"Where", {DatabaseFlag(&db)}},
            {"What the files do not say",
             {{"format", "FORMAT",
               OneOf(&settings.format, {"scores", "dreamer", "tdmpc2"}).Default("by the content"),
               "the format"},
              {"source", "NAME", Text(&settings.source), "who published the curves"},
              {"method", "NAME", Text(&settings.method), "the method"},
              {"obs", "NAME", Text(&settings.obs).Default("by the file's or method's name"),
               "what it observes, state or pixels"},
              {"task", "NAME", Text(&settings.task), "the task"},
              {"steps-per-unit", "N", Whole(&settings.steps_per_unit, 1),
               "environment steps in one unit of the file's steps"}}}}};
  }
  int Run();
};

int Import::Run() {
  // All files are read before anything is written.
  std::vector<std::pair<std::string, std::vector<PublishedPoint>>> parsed;
  for (const std::string& file : files) {
    parsed.emplace_back(file, ParsePublished(file, ReadWholeFile(file), settings));
  }
  const auto database = Database::OpenOrCreate(db);
  for (const auto& [file, points] : parsed) {
    StorePublished(database.get(), points);
    if (std::any_of(points.begin(), points.end(),
                    [](const PublishedPoint& point) { return point.obs == kUnknownObs; })) {
      std::cerr << "note: " << AbsolutePath(file)
                << ": does not say what the method observes. Import it again with --obs state or "
                   "--obs pixels if you know.\n";
    }
    const std::string unknown = UnknownTasks(database.get(), points);
    if (!unknown.empty()) {
      std::cerr << "note: " << AbsolutePath(file) << ": this database has no run of " << unknown
                << "\n";
    }
    std::cout << AbsolutePath(file) << ": " << GroupDigits(static_cast<std::int64_t>(points.size()))
              << " points\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command ImportCommand() { return MakeCommand<Import>(); }

}  // namespace dreamsearch::results
