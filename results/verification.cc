#include "results/verification.h"

#include <cstdio>
#include <map>
#include <tuple>

#include "results/derived_rows.h"
#include "results/schema.h"
#include "results/table.h"

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

void VerifyRun(Database* database, const RunInfo& run, std::vector<std::string>* problems) {
  Connection& db = database->connection();
  const std::string name = "run " + std::to_string(run.run_id) + " (" + run.uuid.substr(0, 8) +
                           ", " + run.task + ", " + run.planner + ", seed " +
                           std::to_string(run.seed) + "): ";
  const Chunks stored = ReadChunks(db, run.run_id, 0);
  const Chunks computed = ComputeChunks(db, run.run_id, 0);
  Chunks keys = stored;
  keys.insert(computed.begin(), computed.end());
  for (const auto& [key, ignored] : keys) {
    const auto& [table, bin] = key;
    const std::string where = name + table + " rows of steps " + Grouped(FirstStepOfBin(bin)) +
                              " to " + Grouped(bin * kBinSteps) + ": ";
    const auto a = stored.find(key), b = computed.find(key);
    const std::int64_t digested = a == stored.end() ? 0 : a->second.rows;
    const std::int64_t found = b == computed.end() ? 0 : b->second.rows;
    if (digested != found) {
      problems->push_back(where + Grouped(digested) + " were written, " + Grouped(found) +
                          " are there");
    } else if (!(a->second == b->second)) {
      problems->push_back(where + "their digest is not the one they were written with");
    }
  }
  const std::optional<Chunk> record = ReadRecord(db, run.run_id);
  if (record && !(*record == ComputeRecord(db, run.run_id))) {
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

}  // namespace

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
  for (const RunInfo& run : database->ListRuns(filter)) VerifyRun(database, run, &problems);
  db.Execute("COMMIT");
  return problems;
}

namespace {

// The value with all its bits: reads back as the same.
std::string ExactText(const Statement& row, int column) {
  if (row.IsNull(column)) return "not finite";
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", row.Real(column));
  const std::string plain = row.Text(column);
  return plain.find_first_of(".eE") == std::string::npos ? plain : text;
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
      where += (i == 0 ? " (" : ", ") + columns[static_cast<std::size_t>(i)] + " " +
               present.Text(i);
    }
    where += "): ";
    if (more_a != more_b) return where + (more_a ? "stored" : "repeated") + " only";
    for (int i = 0; i < static_cast<int>(columns.size()); ++i) {
      const std::string then = ExactText(*a, i), now = ExactText(*b, i);
      if (then == now) continue;
      return where + columns[static_cast<std::size_t>(i)] + " is stored as " + then +
             ", repeated it is " + now;
    }
  }
}

}  // namespace

std::vector<std::string> CompareRuns(Database* stored, std::int64_t stored_run,
                                     Database* repeated, std::int64_t repeated_run) {
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
       {"env_step", "episode", "t", "reward", "value", "simulations", "nodes", "depth"}, 3},
      {"episode",
       "SELECT env_step, phase, episode, length, episode_return, model_transitions, digest"
       " FROM episode WHERE run_id = ?1 ORDER BY env_step, phase, episode",
       {"env_step", "phase", "episode", "length", "episode_return", "model_transitions",
        "digest"}, 3}};
  std::vector<std::string> differences;
  for (const Compared& table : tables) {
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
