#include "results/analysis/published.h"

#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "results/database/schema.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/compressed.h"
#include "results/text/json_text.h"
#include "results/text/table.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

constexpr std::int64_t kMostSteps = std::int64_t{1} << 53;

[[noreturn]] void Malformed(const std::string& path, const std::string& where,
                            const std::string& what) {
  throw Failure(ExitCode::kBadInput,
                AbsolutePath(path) + (where.empty() ? "" : ":" + where) + ": " + what);
}

// Rows of an RFC 4180 file, with the line each begins on.
struct CsvRow {
  int line = 0;
  std::vector<std::string> fields;
};
std::vector<CsvRow> ParseCsv(const std::string& path, const std::string& bytes) {
  std::vector<CsvRow> rows;
  int line = 1;
  std::size_t i = bytes.rfind("\xEF\xBB\xBF", 0) == 0 ? 3 : 0;
  while (i < bytes.size()) {
    CsvRow row;
    row.line = line;
    bool more = true;
    while (more) {
      std::string field;
      if (i < bytes.size() && bytes[i] == '"') {
        ++i;
        while (true) {
          if (i >= bytes.size()) Malformed(path, std::to_string(row.line), "a quote does not end");
          if (bytes[i] == '"' && i + 1 < bytes.size() && bytes[i + 1] == '"')
            ++i;
          else if (bytes[i] == '"')
            break;
          if (bytes[i] == '\n') ++line;
          field += bytes[i++];
        }
        ++i;
      }
      while (i < bytes.size() && bytes[i] != ',' && bytes[i] != '\n') field += bytes[i++];
      if (!field.empty() && field.back() == '\r') field.pop_back();
      more = i < bytes.size() && bytes[i] == ',';
      if (i < bytes.size()) ++i;
      row.fields.push_back(std::move(field));
    }
    ++line;
    if (row.fields.size() > 1 || !row.fields[0].empty()) rows.push_back(std::move(row));
  }
  return rows;
}

void CheckFieldCount(const std::string& path, const CsvRow& header, const CsvRow& row) {
  if (row.fields.size() == header.fields.size()) return;
  Malformed(path, std::to_string(row.line),
            "expected " + std::to_string(header.fields.size()) + " fields, found " +
                std::to_string(row.fields.size()));
}

double ParseReal(const std::string& path, const std::string& where, const std::string& text,
                 const char* what) {
  double value = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end.ec != std::errc() || end.ptr != text.data() + text.size() || !std::isfinite(value)) {
    Malformed(path, where,
              std::string(what) + ": expected a finite number, found '" + Printable(text) + "'");
  }
  return value;
}

std::int64_t ToSteps(const std::string& path, const std::string& where, double value,
                     const ImportSettings& settings) {
  const double steps = value * static_cast<double>(settings.steps_per_unit);
  if (!(steps >= 0) || steps > static_cast<double>(kMostSteps) || steps != std::floor(steps)) {
    Malformed(
        path, where,
        "environment steps: expected a whole number from 0 to 2^53, found " + ExactText(steps));
  }
  return static_cast<std::int64_t>(steps);
}

std::int64_t ToSeed(const std::string& path, const std::string& where, const std::string& text) {
  std::int64_t seed = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), seed);
  if (end.ec != std::errc() || end.ptr != text.data() + text.size() || seed < 0) {
    Malformed(path, where,
              "seed: expected a whole number of at least 0, found '" + Printable(text) + "'");
  }
  return seed;
}

// "state" or "pixels", where words of one of these names tell of one of the two and no other.
std::string ObsOfNames(const std::string& path, const std::string& method) {
  static const std::set<std::string> state = {"proprio", "proprioception", "state", "states"};
  static const std::set<std::string> pixels = {"pixel",   "pixels", "vision", "visual",
                                               "visuals", "image",  "images", "rgb"};
  const std::string file = std::filesystem::path(path).filename().string();
  std::string obs;
  std::string word;
  for (const char c : file + " " + method + " ") {
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) {
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      continue;
    }
    const std::string told = state.count(word) > 0    ? "state"
                             : pixels.count(word) > 0 ? "pixels"
                                                      : "";
    word.clear();
    if (told.empty()) continue;
    if (!obs.empty() && obs != told) return kUnknownObs;
    obs = told;
  }
  return obs.empty() ? kUnknownObs : obs;
}

// The file's name without what says that it was compressed.
std::string PlainName(const std::string& path) {
  const std::filesystem::path name = std::filesystem::path(path).filename();
  return (name.extension() == ".gz" ? name.stem() : name).string();
}

// Points of one key as one, with the mean of their returns, in the order of the first.
std::vector<PublishedPoint> Averaged(std::vector<PublishedPoint> points) {
  std::map<
      std::tuple<std::string, std::string, std::string, std::string, std::int64_t, std::int64_t>,
      std::pair<std::size_t, std::int64_t>>
      places;  // of the points that stay, and of how many each is
  std::vector<PublishedPoint> averaged;
  for (PublishedPoint& point : points) {
    const auto [place, added] =
        places.try_emplace({point.source, point.method, point.obs, point.task,
                            point.seed.value_or(-1), point.env_steps},
                           averaged.size(), 1);
    if (added) {
      averaged.push_back(std::move(point));
      continue;
    }
    auto& [index, count] = place->second;
    double& mean = averaged[index].episode_return;
    mean += (point.episode_return - mean) / static_cast<double>(++count);
  }
  return averaged;
}

const std::string& Or(const std::string& setting, const std::string& otherwise) {
  return setting.empty() ? otherwise : setting;
}

std::vector<PublishedPoint> ParseScores(const std::string& path, const std::vector<CsvRow>& rows,
                                        const ImportSettings& settings) {
  std::map<std::string, std::size_t> columns;
  for (std::size_t i = 0; i < rows[0].fields.size(); ++i) columns[rows[0].fields[i]] = i;
  for (const char* name : {"source", "method", "obs", "task", "env_steps", "seed", "return"}) {
    if (columns.count(name) == 0) {
      Malformed(path, "1", std::string("expected a column '") + name + "' in the header");
    }
  }
  std::vector<PublishedPoint> points;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    const std::string where = std::to_string(rows[r].line);
    CheckFieldCount(path, rows[0], rows[r]);
    const auto field = [&](const char* name) -> std::string {
      const auto found = columns.find(name);
      return found == columns.end() ? "" : rows[r].fields[found->second];
    };
    PublishedPoint point;
    point.source = Or(settings.source, field("source"));
    point.method = Or(settings.method, field("method"));
    point.obs = Or(settings.obs, Or(field("obs"), ObsOfNames("", point.method)));
    point.task = SuiteTaskName(Or(settings.task, field("task")));
    point.env_steps =
        ToSteps(path, where, ParseReal(path, where, field("env_steps"), "env_steps"), settings);
    if (field("seed") != "mean") point.seed = ToSeed(path, where, field("seed"));
    point.episode_return = ParseReal(path, where, field("return"), "return");
    if (!field("n_seeds").empty()) {
      point.n_seeds =
          static_cast<std::int64_t>(ParseReal(path, where, field("n_seeds"), "n_seeds"));
    }
    if (!field("seed_sd").empty()) {
      point.seed_sd = ParseReal(path, where, field("seed_sd"), "seed_sd");
    }
    points.push_back(std::move(point));
  }
  return points;
}

std::vector<PublishedPoint> ParseTdmpc(const std::string& path, const std::vector<CsvRow>& rows,
                                       const ImportSettings& settings) {
  std::map<std::string, std::size_t> columns;
  for (std::size_t i = 0; i < rows[0].fields.size(); ++i) columns[rows[0].fields[i]] = i;
  for (const char* name : {"step", "reward", "seed"}) {
    if (columns.count(name) == 0) {
      Malformed(path, "1", std::string("expected a column '") + name + "' in the header");
    }
  }
  const std::filesystem::path file = AbsolutePath(path);
  const std::string method = file.parent_path().filename().string();
  std::vector<PublishedPoint> points;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    const std::string where = std::to_string(rows[r].line);
    CheckFieldCount(path, rows[0], rows[r]);
    PublishedPoint point;
    point.source = Or(settings.source, method);
    point.method = Or(settings.method, method);
    point.obs = Or(settings.obs, ObsOfNames(path, point.method));
    point.task =
        SuiteTaskName(Or(settings.task, std::filesystem::path(PlainName(path)).stem().string()));
    point.env_steps = ToSteps(
        path, where, ParseReal(path, where, rows[r].fields[columns["step"]], "step"), settings);
    point.seed = ToSeed(path, where, rows[r].fields[columns["seed"]]);
    point.episode_return = ParseReal(path, where, rows[r].fields[columns["reward"]], "reward");
    points.push_back(std::move(point));
  }
  return points;
}

std::vector<PublishedPoint> ParseDreamer(const std::string& path, const std::string& bytes,
                                         const ImportSettings& settings) {
  nlohmann::json list;
  try {
    list = ParseJson(bytes);
  } catch (const nlohmann::json::parse_error& error) {
    Malformed(path, "", std::string("is not JSON: ") + error.what());
  }
  if (!list.is_array()) Malformed(path, "", "expected a list of {task, method, seed, xs, ys}");
  std::vector<PublishedPoint> points;
  std::map<std::tuple<std::string, std::string, std::int64_t>, std::size_t> curves;  // items
  for (std::size_t i = 0; i < list.size(); ++i) {
    const nlohmann::json& item = list[i];
    const std::string where = "item " + std::to_string(i);
    const auto text = [&](const char* name) -> std::string {
      if (!item.is_object() || !item.contains(name)) {
        Malformed(path, where, std::string("expected '") + name + "', found none");
      }
      if (item[name].is_string()) return item[name].get<std::string>();
      if (item[name].is_number_integer()) return JsonText(item[name]);
      Malformed(path, where, std::string("'") + name + "': expected a text or a whole number");
    };
    const auto numbers = [&](const char* name) {
      if (!item.is_object() || !item.contains(name) || !item[name].is_array()) {
        Malformed(path, where, std::string("expected a list '") + name + "'");
      }
      std::vector<double> values;
      for (const nlohmann::json& value : item[name]) {
        if (!value.is_number() || !std::isfinite(value.get<double>())) {
          Malformed(path, where, std::string("'") + name + "': expected finite numbers");
        }
        values.push_back(value.get<double>());
      }
      return values;
    };
    const std::vector<double> xs = numbers("xs"), ys = numbers("ys");
    if (xs.size() != ys.size()) {
      Malformed(path, where,
                "expected as many ys as xs, found " + std::to_string(xs.size()) + " xs and " +
                    std::to_string(ys.size()) + " ys");
    }
    PublishedPoint point;
    point.method = Or(settings.method, text("method"));
    point.source = Or(settings.source, PlainName(path));
    point.obs = Or(settings.obs, ObsOfNames(path, point.method));
    point.task = SuiteTaskName(Or(settings.task, text("task")));
    point.seed = ToSeed(path, where, text("seed"));
    const auto [curve, first] = curves.try_emplace({point.task, point.method, *point.seed}, i);
    if (!first) {
      Malformed(path, where,
                "task, method and seed are those of item " + std::to_string(curve->second) +
                    "; two curves need two seeds");
    }
    for (std::size_t k = 0; k < xs.size(); ++k) {
      point.env_steps = ToSteps(path, where, xs[k], settings);
      point.episode_return = ys[k];
      points.push_back(point);
    }
  }
  return points;
}

}  // namespace

std::string SuiteTaskName(const std::string& name) {
  std::string task = name;
  for (char& c : task) {
    if (c == '-') c = '_';
  }
  if (task.rfind("dmc_", 0) == 0) task = task.substr(4);
  if (task.rfind("ball_in_cup", 0) == 0) task = "cup" + task.substr(11);
  return task;
}

std::vector<PublishedPoint> ParsePublished(const std::string& path, const std::string& packed,
                                           const ImportSettings& settings) {
  const std::string bytes = Unpacked(path, packed);
  std::string format = settings.format;
  const std::size_t first = bytes.find_first_not_of(" \t\r\n");
  if (format.empty() && first != std::string::npos && bytes[first] == '[') format = "dreamer";
  if (format == "dreamer") return Averaged(ParseDreamer(path, bytes, settings));
  const std::vector<CsvRow> rows = ParseCsv(path, bytes);
  if (rows.empty()) Malformed(path, "", "is empty");
  if (format.empty()) {
    bool steps = false;
    for (const std::string& column : rows[0].fields) steps = steps || column == "step";
    format = steps ? "tdmpc2" : "scores";
  }
  if (format == "scores") return Averaged(ParseScores(path, rows, settings));
  if (format == "tdmpc2") return Averaged(ParseTdmpc(path, rows, settings));
  throw Failure(ExitCode::kUsage, "no format '" + format + "'. Known: scores, dreamer, tdmpc2");
}

std::int64_t StorePublished(Database* database, const std::vector<PublishedPoint>& points) {
  Connection& db = database->connection();
  db.Transact([&] {
    Statement insert = db.Prepare(
        "INSERT INTO published (source, method, obs, task, env_steps, seed, episode_return,"
        " n_seeds, seed_sd) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) ON CONFLICT DO UPDATE SET"
        " episode_return = excluded.episode_return, n_seeds = excluded.n_seeds,"
        " seed_sd = excluded.seed_sd, sha256 = ''");
    Statement forget = db.Prepare(
        "DELETE FROM published WHERE source = ?1 AND method = ?2 AND obs = ?3 AND task = ?4 AND"
        " seed IS ?5 AND env_steps = ?6");
    for (const PublishedPoint& point : points) {
      if (point.obs != kUnknownObs) {
        forget
            .Bind(point.source, point.method, std::string(kUnknownObs), point.task, point.seed,
                  point.env_steps)
            .Run();
      }
      insert
          .Bind(point.source, point.method, point.obs, point.task, point.env_steps, point.seed,
                point.episode_return, point.n_seeds, point.seed_sd)
          .Run();
    }
    db.Execute("UPDATE published SET sha256 = " + std::string(kPublishedSha256) +
               " WHERE sha256 = ''");
  });
  return static_cast<std::int64_t>(points.size());
}

std::string DreamerScores(const std::vector<Line>& lines) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Line& line : lines) {
    if (line.published) continue;
    for (const RunCurve& run : line.runs) {
      if (run.env_step.empty()) continue;
      list.push_back({{"task", "dmc_" + line.task},
                      {"method", line.label},
                      {"seed", run.seed},
                      {"xs", run.env_step},
                      {"ys", run.value}});
    }
  }
  return JsonTextReplacing(list) + "\n";
}

std::string TdmpcScores(const Line& line) {
  std::string csv = "step,reward,seed\n";
  for (const RunCurve& run : line.runs) {
    for (std::size_t i = 0; i < run.env_step.size(); ++i) {
      csv += CsvLine({run.env_step[i], run.value[i], run.seed});
    }
  }
  return csv;
}

}  // namespace dreamsearch::results
