// results export - how do other programs get at the rows?
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <set>

#include "results/analysis/published.h"
#include "results/database/query.h"
#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/names.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

// What can be exported as rows; each takes a run_id, and where there is a column
// `phase` a phase or NULL, and names the run's task, planner and seed in front.
const std::map<std::string, std::string>& Queries() {
  static const std::map<std::string, std::string> queries = {
      {"curves",
       "SELECT study, task, planner, model, seed, phase, env_step, mean, episodes FROM v_curve_run"
       " WHERE run_id = ?1 AND phase = ifnull(?2, phase) ORDER BY phase, env_step"},
      {"episodes",
       "SELECT s.name AS study, t.name AS task, r.planner, r.model, r.seed, e.* FROM episode e"
       " JOIN run r USING (run_id) JOIN study s USING (study_id) JOIN task t USING (task_id)"
       " WHERE e.run_id = ?1 AND e.phase = ifnull(?2, e.phase) ORDER BY e.phase, e.episode"},
      {"finals",
       "SELECT * FROM v_final WHERE run_id = ?1 AND phase = ifnull(?2, phase) ORDER BY phase"},
      {"runs", "SELECT * FROM v_run WHERE run_id = ?1"},
      {"scalars",
       "SELECT s.name AS study, t.name AS task, r.planner, r.model, r.seed, x.run_id,"
       " m.name AS metric, m.unit, x.env_step, x.value FROM scalar x JOIN metric m USING"
       " (metric_id) JOIN run r USING (run_id) JOIN study s USING (study_id) JOIN task t USING"
       " (task_id) WHERE x.run_id = ?1 ORDER BY m.name, x.env_step"},
      {"steps",
       "SELECT s.name AS study, t.name AS task, r.planner, r.model, r.seed, x.* FROM step x"
       " JOIN run r USING (run_id) JOIN study s USING (study_id) JOIN task t USING (task_id)"
       " WHERE x.run_id = ?1 ORDER BY x.env_step"},
      {"times",
       "SELECT s.name AS study, t.name AS task, r.planner, r.model, r.seed, x.* FROM time_use x"
       " JOIN run r USING (run_id) JOIN study s USING (study_id) JOIN task t USING (task_id)"
       " WHERE x.run_id = ?1 ORDER BY x.env_step, x.activity"},
  };
  return queries;
}

bool HasPhase(const std::string& sql) { return sql.find("?2") != std::string::npos; }

// A name as part of a path: nothing that leads out of the folder.
std::string FileName(const std::string& name) {
  std::string file;
  for (const char c : Printable(name)) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' ||
                       c == '.' || c == '=' || c == ' ';
    file += plain ? c : '_';
  }
  return file.empty() || file[0] == '.' ? "_" + file : file;
}

// Which runs of several databases would stay if these were merged.
class Merged {
 public:
  explicit Merged(const std::vector<std::unique_ptr<Database>>& databases) {
    for (const GroupedRun& item : TrainedRuns(databases, {})) {
      trained_.emplace(item.run.uuid, item.database);
      for (const std::string& note : item.notes) {
        std::cerr << "note: " << Printable(note) << "\n";
      }
    }
  }
  bool Has(Database* database, const RunInfo& run) {
    const auto trained = trained_.find(run.uuid);
    if (trained != trained_.end()) return trained->second == database;
    if (run.parent_run_id) {
      const std::optional<RunInfo> parent = database->GetRun(*run.parent_run_id);
      if (parent && trained_.count(parent->uuid) == 0) return false;
    } else if (run.env_steps_target > 0) {
      return false;  // another record of its experiment stays
    }
    return evaluations_.insert(run.uuid).second;
  }

 private:
  std::map<std::string, Database*> trained_;  // by UUID
  std::set<std::string> evaluations_;
};

void WriteRows(const std::vector<std::unique_ptr<Database>>& databases, const RunFilter& filter,
               const std::string& sql, std::optional<CurvePhase> phase, bool csv,
               const std::string& out) {
  std::unique_ptr<OutputFile> file;
  if (!out.empty()) file = std::make_unique<OutputFile>(out);
  const auto write = [&file](const std::string& line) {
    if (file != nullptr) {
      file->Append(line);
    } else {
      std::cout << line;
    }
  };
  Merged merged(databases);
  bool first = true;
  for (const auto& database : databases) {
    Statement rows = database->connection().Prepare(sql);
    std::vector<std::string> columns;
    for (int i = 0; i < rows.columns(); ++i) columns.push_back(rows.ColumnName(i));
    CheckNamesDiffer(columns);
    if (csv && first) write(CsvLine({columns.begin(), columns.end()}));
    first = false;
    for (const RunInfo& run : database->ListRuns(filter)) {
      if (!merged.Has(database.get(), run)) continue;
      if (HasPhase(sql)) {
        rows.Bind(run.run_id, phase ? std::optional<std::int64_t>(
                                          PhaseOf(database->connection(), run.run_id, *phase))
                                    : std::nullopt);
      } else {
        rows.Bind(run.run_id);
      }
      while (rows.Step()) {
        write(csv ? CsvLine(ReadCells(rows)) : JsonLine(columns, ReadCells(rows)));
      }
    }
  }
  if (file != nullptr) {
    file->Close();
    std::cerr << "wrote " << AbsolutePath(out) << "\n";
  }
}

struct Export {
  Selection selection;
  std::string format = "csv", rows = "episodes", out;
  std::optional<CurvePhase> phase;

  CommandSpec Declare() {
    std::vector<std::string> names;
    for (const auto& [name, sql] : Queries()) names.push_back(name);
    return {
        .name = "results export",
        .summary = "writes rows or learning curves for other programs",
        .examples = {"results export --rows episodes --out episodes.csv",
                     "results export --format tdmpc2 --out scores"},
        .about =
            "Writes rows as CSV or JSON lines, or learning curves in the formats that "
            "Dreamer (one JSON list) and TD-MPC2 (a folder with a CSV of each task for each "
            "planner) publish their scores in.",
        .groups = {
            SelectionFlags(&selection),
            {"What to write",
             {{"format", "FORMAT", OneOf(&format, {"csv", "jsonl", "dreamer", "tdmpc2"}),
               "the format"},
              {"rows", "ROWS", OneOf(&rows, names), "the rows of csv and jsonl"},
              {"phase", "PHASE", OneOf(&phase, PhaseChoices()).Default("evaluation; for rows all"),
               "which episodes; for dreamer and tdmpc2 and for the rows curves, episodes "
               "and finals"}}},
            {"Where to",
             {{"out", "FILE", Text(&out).Default("standard output"),
               "write to this file; for tdmpc2 to this folder"}}}}};
  }
  int Run();
};

int Export::Run() {
  const auto query = Queries().find(rows);
  const bool as_rows = format == "csv" || format == "jsonl";
  if (as_rows && phase && !HasPhase(query->second)) {
    throw Failure(ExitCode::kUsage,
                  "results export: --phase: rows of '" + rows + "' have no phase");
  }
  const auto databases = OpenSelected(selection);
  if (as_rows) {
    WriteRows(databases, selection.filter, query->second, phase, format == "csv", out);
    return static_cast<int>(ExitCode::kOk);
  }
  const std::vector<Line> lines = ReadLines(
      databases, {.filter = selection.filter, .phase = phase.value_or(CurvePhase::kEvaluation)});
  if (format == "dreamer") {
    if (out.empty()) {
      std::cout << DreamerScores(lines);
    } else {
      WriteFile(out, DreamerScores(lines));
      std::cerr << "wrote " << AbsolutePath(out) << "\n";
    }
    return static_cast<int>(ExitCode::kOk);
  }
  if (out.empty()) {
    throw Failure(ExitCode::kUsage,
                  "results export: --format tdmpc2: expected --out FOLDER, found none");
  }
  for (const Line& line : lines) {
    const std::filesystem::path folder = std::filesystem::path(out) / FileName(line.label);
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) {
      throw Failure(ExitCode::kCannotCreate,
                    AbsolutePath(folder.string()) + ": " + error.message());
    }
    std::string task = FileName(line.task);
    for (char& c : task) {
      if (c == '_') c = '-';
    }
    WriteFile((folder / (task + ".csv")).string(), TdmpcScores(line));
  }
  std::cerr << "wrote " << lines.size() << (lines.size() == 1 ? " file" : " files") << " below "
            << AbsolutePath(out) << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command ExportCommand() { return MakeCommand<Export>(); }

}  // namespace dreamsearch::results
