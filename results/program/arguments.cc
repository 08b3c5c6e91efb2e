#include "results/program/arguments.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <set>
#include <sstream>

#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/names.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

namespace po = boost::program_options;

std::string FormOfPath(const std::string& path) {
  const std::string suffix = std::filesystem::path(path).extension().string();
  return suffix == ".txt"    ? "text"
         : suffix == ".md"   ? "markdown"
         : suffix == ".csv"  ? "csv"
         : suffix == ".json" ? "json"
                             : "";
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

std::int64_t ParseNumber(const std::string& text, const std::string& what, std::int64_t least) {
  std::int64_t value = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end.ec != std::errc() || end.ptr != text.data() + text.size() || value < least) {
    throw Failure(ExitCode::kUsage, what + ": expected a whole number of at least " +
                                        std::to_string(least) + ", found '" + Printable(text) +
                                        "'");
  }
  return value;
}

Arguments::Arguments(const std::string& name, const std::string& usage, const std::string& summary)
    : name_(name), usage_(usage), summary_(summary), options_("Options", 100, 60) {
  options_.add_options()("help,h", "print this help");
}

void Arguments::AddDatabase() {
  Add()("db", po::value<std::vector<std::string>>()->value_name("FILE"),
        "results database; several times, or a comma list, where that makes sense "
        "(default: results/dreamsearch.db)");
}

void Arguments::AddFilter() {
  const auto list = [] { return po::value<std::vector<std::string>>()->value_name("LIST"); };
  Add()("study", list(), "only these studies")("env", list(), "only these tasks")(
      "planner", list(), "only these planners")("seed", list(), "only these seeds");
}

void Arguments::AddPositional(const std::string& name, bool many) {
  hidden_.add_options()(name.c_str(), po::value<std::vector<std::string>>());
  positional_.add(name.c_str(), many ? -1 : 1);
}

bool Arguments::Parse(const std::vector<std::string>& arguments) {
  po::options_description all;
  all.add(options_).add(hidden_);
  namespace style = po::command_line_style;
  try {
    po::store(po::command_line_parser(arguments)
                  .options(all)
                  .positional(positional_)
                  .style(style::unix_style & ~style::allow_guessing)
                  .run(),
              values_);
    po::notify(values_);
  } catch (const po::error& error) {
    throw Failure(ExitCode::kUsage,
                  std::string(error.what()) + ". See `results " + name_ + " --help`.");
  }
  if (!Has("help")) return true;
  std::cout << "results " << name_ << (usage_.empty() ? "" : " ") << usage_ << "\n\n"
            << summary_ << "\n\n"
            << options_;
  return false;
}

std::vector<std::string> Arguments::List(const std::string& name) const {
  std::vector<std::string> items;
  if (!Has(name)) return items;
  for (const std::string& text : Get<std::vector<std::string>>(name)) {
    std::istringstream parts(text);
    std::string part;
    while (std::getline(parts, part, ',')) {
      if (!part.empty()) items.push_back(part);
    }
  }
  return items;
}

Selection Arguments::GetSelection() const {
  Selection selection;
  if (Has("db")) {
    // A file whose name has a comma is taken as it is.
    selection.databases.clear();
    for (const std::string& text : Get<std::vector<std::string>>("db")) {
      if (std::filesystem::exists(text)) {
        selection.databases.push_back(text);
        continue;
      }
      std::istringstream parts(text);
      std::string part;
      while (std::getline(parts, part, ',')) selection.databases.push_back(part);
    }
  }
  if (selection.databases.empty()) {
    throw Failure(ExitCode::kUsage, "--db: expected the name of a database, found nothing");
  }
  selection.filter.studies = List("study");
  selection.filter.tasks = List("env");
  selection.filter.planners = List("planner");
  for (const std::string& seed : List("seed")) {
    selection.filter.seeds.push_back(ParseNumber(seed, "--seed", 0));
  }
  for (const std::string& status : List("status")) {
    try {
      selection.filter.statuses.push_back(ParseRunStatus(status));
    } catch (const Failure& error) {
      throw Failure(ExitCode::kUsage, std::string("--status: ") + error.what());
    }
  }
  return selection;
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

bool IsTablePath(const std::string& path) { return !FormOfPath(path).empty(); }
TableForm FormOfTablePath(const std::string& path) { return ParseTableForm(FormOfPath(path)); }

void PrintTable(const Table& table, const std::string& form, const std::string& out) {
  if (out.empty()) {
    std::cout << table.Print(ParseTableForm(form)) << std::flush;
    return;
  }
  if (!IsTablePath(out)) {
    throw Failure(
        ExitCode::kUsage,
        AbsolutePath(out) + ": expected a table's suffix, one of .txt, .md, " + ".csv, .json");
  }
  WriteFile(out, table.Print(ParseTableForm(FormOfPath(out))));
  std::cerr << "wrote " << AbsolutePath(out) << "\n";
}

}  // namespace dreamsearch::results
