#include "results/upkeep/verification.h"

#include <map>
#include <optional>
#include <tuple>

#include "results/database/derived_rows.h"
#include "results/database/schema.h"
#include "results/system/sha256.h"
#include "results/text/table.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

using Bin = std::tuple<std::int64_t, double, std::int64_t>;         // n, sum_return, nonfinite
using Bins = std::map<std::pair<std::int64_t, std::int64_t>, Bin>;  // by phase and bin

Bins StoredBins(Connection& db, std::int64_t run_id) {
  Bins bins;
  Statement rows = db.Prepare(
      "SELECT phase, env_step_bin, n, sum_return, nonfinite FROM curve_bin WHERE run_id = ?1");
  rows.Bind(run_id);
  while (rows.Step()) bins[{rows.Int(0), rows.Int(1)}] = {rows.Int(2), rows.Real(3), rows.Int(4)};
  return bins;
}

Bins BinsOfEpisodes(Connection& db, std::int64_t run_id) {
  Bins bins;
  Statement rows = db.Prepare(
      "SELECT phase, env_step, episode_return FROM episode"
      " WHERE run_id = ?1 ORDER BY phase, episode");
  rows.Bind(run_id);
  while (rows.Step()) {
    auto& [n, sum, nonfinite] = bins[{rows.Int(0), BinOf(rows.Int(1))}];
    if (rows.IsNull(2)) {
      ++nonfinite;
    } else {
      ++n;
      sum += rows.Real(2);
    }
  }
  return bins;
}

// Places where rows are missing: the first in words, the others counted.
class Holes {
 public:
  explicit Holes(std::string what) : what_(std::move(what)) {}
  void Add(const std::string& where) {
    if (count_++ == 0) first_ = where;
  }
  void Report(const std::string& name, std::vector<std::string>* problems) const {
    if (count_ == 0) return;
    problems->push_back(name + what_ + " are missing " + first_ +
                        (count_ > 1 ? ", and in " + GroupDigits(count_ - 1) + " more places" : ""));
  }

 private:
  std::string what_;
  std::string first_;
  std::int64_t count_ = 0;
};

std::string Between(std::int64_t before, std::int64_t after) {
  return "between environment steps " + GroupDigits(before) + " and " + GroupDigits(after);
}

// Decisions are numbered from 0 in each episode and make at most action_repeat steps.
void FindHolesInSteps(Connection& db, const RunInfo& run, const std::string& name,
                      std::vector<std::string>* problems) {
  Holes holes("decisions");
  Statement rows =
      db.Prepare("SELECT env_step, episode, t FROM step WHERE run_id = ?1 ORDER BY env_step");
  rows.Bind(run.run_id);
  std::int64_t env_step = 0, episode = -1, t = 0;
  while (rows.Step()) {
    const bool next = rows.Int(1) == episode ? rows.Int(2) == t + 1
                                             : rows.Int(1) == episode + 1 && rows.Int(2) == 0;
    if (!next || rows.Int(0) - env_step > run.action_repeat) {
      holes.Add(Between(env_step, rows.Int(0)));
    }
    env_step = rows.Int(0);
    episode = rows.Int(1);
    t = rows.Int(2);
  }
  // A run that records no decisions has no holes in them; an evaluation is such a run.
  if (episode >= 0 && env_step < run.env_steps_done) {
    holes.Add(Between(env_step, run.env_steps_done));
  }
  holes.Report(name, problems);
}

// Episodes are numbered from 0 in each phase; those of training follow each other.
void FindHolesInEpisodes(Connection& db, const RunInfo& run, const std::string& name,
                         std::vector<std::string>* problems) {
  Holes training("training episodes"), evaluation("evaluation episodes");
  Statement rows = db.Prepare(
      "SELECT phase, episode, env_step, length FROM episode WHERE run_id = ?1"
      " ORDER BY phase, episode");
  rows.Bind(run.run_id);
  std::int64_t phase = -1, expected = 0, env_step = 0;
  while (rows.Step()) {
    if (rows.Int(0) != phase) {
      phase = rows.Int(0);
      expected = env_step = 0;
    }
    const bool trained = phase == static_cast<std::int64_t>(Phase::kTraining);
    if (rows.Int(1) != expected || (trained && rows.Int(2) != env_step + rows.Int(3))) {
      if (trained) {
        training.Add(Between(env_step, rows.Int(2)));
      } else {
        evaluation.Add("before episode " + GroupDigits(rows.Int(1)) + " of phase " +
                       std::to_string(phase));
      }
    }
    expected = rows.Int(1) + 1;
    env_step = rows.Int(2);
  }
  training.Report(name, problems);
  evaluation.Report(name, problems);
}

// A segment begins at a checkpoint, so never past the end of the one before it.
void FindHolesInSegments(Connection& db, const RunInfo& run, const std::string& name,
                         std::vector<std::string>* problems) {
  Statement rows = db.Prepare(
      "SELECT segment, from_env_step, to_env_step FROM segment WHERE run_id = ?1"
      " ORDER BY segment");
  rows.Bind(run.run_id);
  std::int64_t expected = 0;
  std::optional<std::int64_t> end = 0;
  while (rows.Step()) {
    const std::string segment = name + "segment " + std::to_string(rows.Int(0));
    if (rows.Int(0) != expected) {
      problems->push_back(segment + " is there, but not segment " + std::to_string(expected));
    } else if (end && rows.Int(1) > *end) {
      problems->push_back(segment + " begins at environment step " + GroupDigits(rows.Int(1)) +
                          ", but what was before it ended at " + GroupDigits(*end));
    }
    expected = rows.Int(0) + 1;
    end = rows.OptionalInt(2);
  }
}

std::string NameOf(const RunInfo& run) {
  return "run " + std::to_string(run.run_id) + " (" + run.uuid.substr(0, 8) + ", " + run.task +
         ", " + run.planner + ", seed " + std::to_string(run.seed) + "): ";
}

void CheckDigests(Database* database, const RunInfo& run, std::vector<std::string>* problems) {
  Connection& db = database->connection();
  const std::string name = NameOf(run);
  const Chunks stored = ReadChunks(db, run.run_id, 0);
  const Chunks computed = ComputeChunks(db, run.run_id, 0);
  Chunks keys = stored;
  keys.insert(computed.begin(), computed.end());
  for (const auto& [key, ignored] : keys) {
    const auto& [table, bin] = key;
    const std::string where = name + table + " rows of steps " + GroupDigits(FirstStepOfBin(bin)) +
                              " to " + GroupDigits(bin * kBinSteps) + ": ";
    const auto a = stored.find(key), b = computed.find(key);
    const std::int64_t digested = a == stored.end() ? 0 : a->second.rows;
    const std::int64_t found = b == computed.end() ? 0 : b->second.rows;
    if (digested != found) {
      problems->push_back(where + GroupDigits(digested) + " were written, " + GroupDigits(found) +
                          " are there");
    } else if (!(a->second == b->second)) {
      problems->push_back(where + "their digest is not the one they were written with");
    }
  }
  if (!RecordIsAsSealed(db, run.run_id)) {
    problems->push_back(name +
                        "its record (settings, programs, segments, times, events, files) is "
                        "not the one it ended with");
  }
  if (StoredBins(db, run.run_id) != BinsOfEpisodes(db, run.run_id)) {
    problems->push_back(name + "curve_bin does not follow from its episodes");
  }
  if (!run.result_digest.empty() &&
      run.result_digest != database->ComputeResultDigest(run.run_id)) {
    problems->push_back(name + "its episodes do not have its result digest");
  }
  if (Sha256Hex(run.config_json) != run.config_sha256) {
    problems->push_back(name + "its configuration does not have its SHA-256");
  }
}

// The tables, indices, triggers and views that answer for what is stored: each as this program
// makes it. What else is there is the user's own, but for triggers, which change rows.
void VerifySchema(Database* database, std::vector<std::string>* problems) {
  for (const std::string& object : database->ChangedSchema()) {
    problems->push_back("schema: " + object + " is not as this program makes it");
  }
}

// What is no run's own: what metrics mean, studies, published points.
void VerifySharedRows(Connection& db, std::vector<std::string>* problems) {
  Statement metrics = db.Prepare("SELECT name FROM metric WHERE doc_sha256 IS NOT sha256(doc)");
  while (metrics.Step()) {
    problems->push_back("metric " + metrics.Text(0) + ": its doc does not have its SHA-256");
  }
  Statement studies =
      db.Prepare("SELECT name FROM study WHERE sha256 IS NOT " + std::string(kStudySha256));
  while (studies.Step()) {
    problems->push_back("study " + studies.Text(0) + ": its row does not have its SHA-256");
  }
  const std::int64_t points = db.QueryInt("SELECT count(*) FROM published WHERE sha256 IS NOT " +
                                          std::string(kPublishedSha256))
                                  .value_or(0);
  if (points > 0) {
    problems->push_back("published: " + GroupDigits(points) +
                        " points do not have their SHA-256; import them again");
  }
}

// Where a run's files are, which a merge changes.
void CheckPaths(Connection& db, const RunInfo& run, std::vector<std::string>* problems) {
  Statement paths = db.Prepare(
      "SELECT 'log_path', log_path FROM run WHERE run_id = ?1 AND"
      " log_path_sha256 IS NOT sha256(log_path) UNION ALL SELECT 'path of an artifact', path FROM"
      " artifact WHERE run_id = ?1 AND path_sha256 IS NOT sha256(path)");
  paths.Bind(run.run_id);
  while (paths.Step()) {
    problems->push_back(NameOf(run) + "its " + paths.Text(0) + ", " + Printable(paths.Text(1)) +
                        ", does not have its SHA-256");
  }
}

void VerifyRun(Database* database, const RunInfo& run, std::vector<std::string>* problems) {
  CheckDigests(database, run, problems);
  Connection& db = database->connection();
  FindHolesInSteps(db, run, NameOf(run), problems);
  FindHolesInEpisodes(db, run, NameOf(run), problems);
  FindHolesInSegments(db, run, NameOf(run), problems);
  CheckPaths(db, run, problems);
}

}  // namespace

std::vector<std::string> WhyNotAsWritten(Database* database, const RunInfo& run) {
  std::vector<std::string> problems;
  database->connection().Execute("BEGIN");  // one state of a run that may go on meanwhile
  CheckDigests(database, run, &problems);
  database->connection().Execute("COMMIT");
  return problems;
}

std::vector<std::string> Verify(Database* database, const RunFilter& filter) {
  Connection& db = database->connection();
  std::vector<std::string> problems;
  db.Execute("BEGIN");
  Statement integrity = db.Prepare("PRAGMA integrity_check");
  while (integrity.Step()) {
    if (integrity.Text(0) != "ok") problems.push_back("structure: " + integrity.Text(0));
  }
  Statement keys = db.Prepare("PRAGMA foreign_key_check");
  while (keys.Step()) {
    problems.push_back("a row of " + keys.Text(0) + " refers to a row of " + keys.Text(2) +
                       " that is not there");
  }
  VerifySchema(database, &problems);
  VerifySharedRows(db, &problems);
  for (const RunInfo& run : database->ListRuns(filter)) VerifyRun(database, run, &problems);
  db.Execute("COMMIT");
  return problems;
}

namespace {

// The value with all its bits: reads back as the same.
std::string StoredText(const Statement& row, int column) {
  if (row.IsNull(column)) return "not finite";
  const std::string plain = row.Text(column);
  return plain.find_first_of(".eE") == std::string::npos ? plain : ExactText(row.Real(column));
}

// The first row in which two queries differ; the first `keys` columns say where.
std::string FirstDifference(Statement* a, Statement* b, const std::string& what,
                            const std::vector<std::string>& columns, int keys) {
  for (;;) {
    const bool more_a = a->Step(), more_b = b->Step();
    if (!more_a && !more_b) return "";
    const Statement& present = more_a ? *a : *b;
    std::string where = what;
    for (int i = 0; i < keys; ++i) {
      where +=
          (i == 0 ? " (" : ", ") + columns[static_cast<std::size_t>(i)] + " " + present.Text(i);
    }
    where += "): ";
    if (more_a != more_b) return where + (more_a ? "stored" : "repeated") + " only";
    for (int i = 0; i < static_cast<int>(columns.size()); ++i) {
      const std::string then = StoredText(*a, i), now = StoredText(*b, i);
      if (then == now) continue;
      return where + columns[static_cast<std::size_t>(i)] + " is stored as " + then +
             ", repeated it is " + now;
    }
  }
}

}  // namespace

std::vector<std::string> CompareRuns(Database* stored, std::int64_t stored_run, Database* repeated,
                                     std::int64_t repeated_run) {
  struct Compared {
    const char* what;
    const char* sql;
    std::vector<std::string> columns;
    int keys;
  };
  const Compared tables[] = {
      {"decision",
       "SELECT env_step, episode, t, reward, value, simulations, nodes, depth FROM step"
       " WHERE run_id = ?1 ORDER BY env_step",
       {"env_step", "episode", "t", "reward", "value", "simulations", "nodes", "depth"},
       3},
      {"episode",
       "SELECT env_step, phase, episode, length, episode_return, model_transitions, digest"
       " FROM episode WHERE run_id = ?1 ORDER BY env_step, phase, episode",
       {"env_step", "phase", "episode", "length", "episode_return", "model_transitions", "digest"},
       3}};
  // Those of a run that was merged without them cannot be compared.
  const bool decisions =
      stored->connection().Prepare("SELECT 1 FROM step WHERE run_id = ?1").Bind(stored_run).Step();
  std::vector<std::string> differences;
  for (const Compared& table : tables) {
    if (&table == &tables[0] && !decisions) continue;
    Statement a = stored->connection().Prepare(table.sql);
    Statement b = repeated->connection().Prepare(table.sql);
    a.Bind(stored_run);
    b.Bind(repeated_run);
    const std::string found = FirstDifference(&a, &b, table.what, table.columns, table.keys);
    if (!found.empty()) differences.push_back(found);
  }
  return differences;
}

}  // namespace dreamsearch::results
