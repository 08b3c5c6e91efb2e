#include "results/program/selection.h"

#include <filesystem>
#include <iostream>
#include <map>
#include <set>
#include <stdexcept>

#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/names.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

// The default goes when the first name comes. A file whose name has a comma is taken as it
// is.
FlagValue Databases(std::vector<std::string>* to) {
  const auto read = [to, first = true](const Given& given) mutable {
    if (std::exchange(first, false)) to->clear();
    if (std::filesystem::exists(given.text)) {
      to->push_back(given.text);
      return;
    }
    const std::vector<std::string> paths = SplitCommas(given.text);
    if (paths.empty()) throw std::invalid_argument("expected the name of a database");
    to->insert(to->end(), paths.begin(), paths.end());
  };
  return FlagValue{read, FlagValue::Takes::kTexts}.Default(to->front());
}

FlagValue Seeds(std::vector<std::int64_t>* to) {
  return ListOf(to, [](const std::string& text) {
    return static_cast<std::int64_t>(ParseWhole(text, 0, std::numeric_limits<std::int64_t>::max()));
  });
}

void CheckNames(const std::vector<std::unique_ptr<Database>>& databases, const char* what,
                const char* sql, const std::vector<std::string>& names) {
  if (names.empty()) return;
  std::set<std::string> known;
  for (const auto& database : databases) {
    Statement rows = database->connection().Prepare(sql);
    while (rows.Step()) known.insert(rows.Text(0));
  }
  for (const std::string& name : names) {
    if (known.count(name) > 0) continue;
    throw Failure(ExitCode::kUsage, std::string("no ") + what + " '" + Printable(name) + "' in " +
                                        databases.front()->path() +
                                        (databases.size() > 1 ? " and the others" : "") + ". " +
                                        KnownNames(name, {known.begin(), known.end()}));
  }
}

}  // namespace

FlagGroup SelectionFlags(Selection* selection) {
  FlagGroup group = {
      "Which runs",
      {{"db", "FILE", Databases(&selection->databases), "results databases, separated by commas"}}};
  for (Flag& flag : FilterFlags(&selection->filter)) group.flags.push_back(std::move(flag));
  return group;
}

std::vector<Flag> FilterFlags(RunFilter* filter) {
  return {{"study", "LIST", ListOf(&filter->studies), "only these studies"},
          {"env", "LIST", ListOf(&filter->tasks), "only these tasks"},
          {"planner", "LIST", ListOf(&filter->planners), "only these planners"},
          {"seed", "LIST", Seeds(&filter->seeds), "only these seeds"}};
}

Flag StatusFlag(RunFilter* filter) {
  std::vector<ChoiceName> names;
  for (int i = 0; i < 8; ++i) names.push_back({RunStatusName(static_cast<RunStatus>(i))});
  FlagValue value = ListOf(&filter->statuses, ParseRunStatus);
  value.choices = ChoicesText(names);
  return {"status", "LIST", std::move(value), "only runs with these statuses"};
}

const Choices<CurvePhase>& PhaseChoices() {
  static const Choices<CurvePhase> choices = {{"evaluation", CurvePhase::kEvaluation},
                                              {"training", CurvePhase::kTraining, {"0"}},
                                              {"search", CurvePhase::kSearchEvaluation, {"1"}},
                                              {"actor", CurvePhase::kActorEvaluation, {"2"}}};
  return choices;
}

Flag FormFlag(TableForm* form) {
  return {"format", "FORMAT",
          OneOf(form, Choices<TableForm>{{"text", TableForm::kText},
                                         {"markdown", TableForm::kMarkdown},
                                         {"csv", TableForm::kCsv},
                                         {"json", TableForm::kJson}}),
          "how to print the table"};
}

Flag PublishedFlag(std::vector<std::string>* published) {
  return {"published", "LIST", ListOf(published),
          "draw these imported curves as well: METHOD, METHOD/OBS or all"};
}

Flag BootstrapSeedFlag(std::uint64_t* seed) {
  return {"bootstrap-seed", "N", Whole(seed, 0, std::numeric_limits<std::int64_t>::max()),
          "seed of the bootstrap; equal seeds give equal intervals"};
}

std::optional<TableForm> FormOfTablePath(const std::string& path) {
  static const std::map<std::string, TableForm> forms = {{".txt", TableForm::kText},
                                                         {".md", TableForm::kMarkdown},
                                                         {".csv", TableForm::kCsv},
                                                         {".json", TableForm::kJson}};
  const auto found = forms.find(std::filesystem::path(path).extension().string());
  return found == forms.end() ? std::nullopt : std::optional(found->second);
}

std::vector<std::unique_ptr<Database>> OpenSelected(const Selection& selection) {
  std::vector<std::unique_ptr<Database>> databases;
  for (const std::string& path : selection.databases) {
    databases.push_back(Database::OpenReadOnly(path));
  }
  CheckNames(databases, "study", "SELECT name FROM study", selection.filter.studies);
  CheckNames(databases, "task", "SELECT name FROM task", selection.filter.tasks);
  CheckNames(databases, "planner", "SELECT DISTINCT planner FROM run", selection.filter.planners);
  return databases;
}

void CheckPublished(const std::vector<std::unique_ptr<Database>>& databases,
                    const std::vector<std::string>& methods) {
  if (methods.empty()) return;
  std::set<std::string> known;
  for (const auto& database : databases) {
    Statement rows = database->connection().Prepare("SELECT DISTINCT method, obs FROM published");
    while (rows.Step()) {
      known.insert(rows.Text(0));
      known.insert(rows.Text(0) + "/" + rows.Text(1));
    }
  }
  for (const std::string& method : methods) {
    if (known.count(method) > 0 || (method == "all" && !known.empty())) continue;
    throw Failure(ExitCode::kNotFound,
                  "--published: no '" + Printable(method) + "' in " + databases.front()->path() +
                      (databases.size() > 1 ? " and the others" : "") + ". " +
                      KnownNames(method, {known.begin(), known.end()}) +
                      (known.empty() ? " `results import` takes them from a file." : ""));
  }
}

void PrintTable(const Table& table, TableForm form, const std::string& out) {
  if (out.empty()) {
    std::cout << table.Print(form) << std::flush;
    return;
  }
  const std::optional<TableForm> of_path = FormOfTablePath(out);
  if (!of_path) {
    throw Failure(ExitCode::kUsage,
                  "--out: " + AbsolutePath(out) +
                      ": expected a table's suffix, one of .txt, .md, .csv, .json");
  }
  WriteFile(out, table.Print(*of_path));
  std::cerr << "wrote " << AbsolutePath(out) << "\n";
}

}  // namespace dreamsearch::results
