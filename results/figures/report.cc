#include "results/figures/report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "results/database/query.h"
#include "results/figures/comparison_figure.h"
#include "results/figures/curve_figure.h"
#include "results/figures/page/embedded.h"
#include "results/system/error.h"
#include "results/system/json_text.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kMostPoints = 40;

std::string Escaped(const std::string& text) {
  std::string html;
  for (const char c : Printable(text)) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      case '\'':
        html += "&#39;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

// How many neighbouring points become one, so that at most kMostPoints of each of our
// runs are left. Published curves are not thinned.
std::size_t GroupSize(const std::vector<Line>& lines) {
  std::size_t most = 1;
  for (const Line& line : lines) {
    if (line.published) continue;
    for (const RunCurve& run : line.runs) most = std::max(most, run.env_step.size());
  }
  return (most + kMostPoints - 1) / kMostPoints;
}

// Replaces so many neighbouring points by their mean.
void Thin(std::size_t group, std::vector<Line>* lines) {
  if (group <= 1) return;
  for (Line& line : *lines) {
    if (line.published) continue;
    for (RunCurve& run : line.runs) {
      RunCurve thin = run;
      thin.x.clear();
      thin.env_step.clear();
      thin.value.clear();
      // The first point, of the untrained agent, stays by itself.
      for (std::size_t i = 0; i < run.env_step.size();) {
        const std::size_t count = i == 0 ? 1 : std::min(group, run.env_step.size() - i);
        double sum = 0;
        for (std::size_t k = i; k < i + count; ++k) sum += run.value[k];
        thin.env_step.push_back(run.env_step[i + count - 1]);
        thin.x.push_back(run.x[i + count - 1]);
        thin.value.push_back(sum / static_cast<double>(count));
        i += count;
      }
      run = std::move(thin);
    }
  }
}

// A text in SQL.
std::string SqlText(const std::string& text) {
  std::string sql = "'";
  for (const char c : text) {
    if (c == '\'') sql += c;
    sql += c;
  }
  return sql + "'";
}

// " AND COLUMN IN ('a', 'b')"; nothing for an empty list.
std::string SqlIn(const std::string& column, const std::vector<std::string>& texts) {
  if (texts.empty()) return "";
  std::string sql;
  for (const std::string& text : texts) sql += (sql.empty() ? "" : ", ") + SqlText(text);
  return "\n    AND " + column + " IN (" + sql + ")";
}

// Four significant digits are more than a screen shows.
ordered_json Rounded(double value) {
  if (!std::isfinite(value)) return nullptr;
  if (value == 0) return 0;
  const double unit = std::pow(10, std::floor(std::log10(std::abs(value))) - 3);
  const double rounded = std::round(value / unit) * unit;
  if (std::abs(rounded) < 9e15 && rounded == std::floor(rounded)) {
    return static_cast<std::int64_t>(rounded);
  }
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return std::strtod(text, nullptr);
}

class Page {
 public:
  Page(const std::vector<std::unique_ptr<Database>>& databases, const ReportRequest& request)
      : databases_(databases), request_(request) {}

  std::string Make() {
    CurveRequest curves = {.filter = request_.filter, .published = request_.published};
    lines_ = ReadLines(databases_, curves);
    if (lines_.empty()) {
      throw Failure(ExitCode::kNotFound, NothingToGroup(databases_, request_.filter));
    }
    points_ = GroupSize(lines_);
    Thin(points_, &lines_);
    std::set<std::string> uuids;
    for (const auto& database : databases_) {
      RunFilter mains = request_.filter;
      mains.with_evaluations = false;
      for (RunInfo& run : database->ListRuns(mains)) {
        if (!uuids.insert(run.uuid).second) continue;
        runs_.push_back(std::move(run));
        homes_.push_back(database.get());
      }
    }
    const std::string title = request_.title.empty() ? "Results: " + StudyNames() : request_.title;
    html_ << "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
          << "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>"
          << Escaped(title) << "</title>\n<style>" << PageStyle() << "</style>\n"
          << "<noscript><style>.chart, figure[data-task] { display: none; }</style></noscript>\n"
          << "</head>\n<body>\n"
          << "<h1>" << Escaped(title) << "</h1>\n";
    Summary();
    Curves(curves);
    OverTasks(curves);
    Time();
    Comparisons();
    Runs();
    Settings();
    html_ << "<script type=\"application/json\" id=\"data\">" << Data(curves)
          << "</script>\n<script>" << ChartLibrary() << "</script>\n<script>" << PageScript()
          << "</script>\n</body>\n</html>\n";
    return html_.str();
  }

 private:
  std::string StudyNames() const {
    std::set<std::string> names;
    for (const RunInfo& run : runs_) names.insert(run.study);
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text;
  }

  void Heading(const std::string& id, const std::string& text) {
    html_ << "<h2 id=\"" << id << "\">" << Escaped(text) << "</h2>\n";
  }
  void Note(const std::string& text) { html_ << "<p class=\"note\">" << Escaped(text) << "</p>\n"; }
  void Query(const std::string& sql) {
    html_ << "<details><summary>The query behind it</summary><pre><code>";
    for (const std::string& line : Split(sql)) html_ << Escaped(line) << "\n";
    html_ << "</code></pre></details>\n";
  }

  // Whether points are bins rather than evaluations.
  bool Binned() const {
    return std::any_of(lines_.begin(), lines_.end(), [](const Line& line) { return line.binned; });
  }
  // The condition that RunFilter is, as SQL.
  std::string Chosen(const std::string& study, const std::string& task, const std::string& planner,
                     const std::string& seed) const {
    const RunFilter& filter = request_.filter;
    std::string sql =
        SqlIn(study, filter.studies) + SqlIn(task, filter.tasks) + SqlIn(planner, filter.planners);
    std::string seeds;
    for (const std::int64_t s : filter.seeds)
      seeds += (seeds.empty() ? "" : ", ") + std::to_string(s);
    if (!seeds.empty()) sql += "\n    AND " + seed + " IN (" + seeds + ")";
    return sql;
  }
  // A run's line: its planner, or, where one planner has several, by the run.
  std::string LineOfRun() const {
    std::map<std::string, std::string> uuids;  // by label
    std::set<std::string> planners;
    for (const Line& line : lines_) {
      if (line.published) continue;
      planners.insert(line.planner);
      for (const RunCurve& run : line.runs) {
        std::string& list = uuids[line.label];
        list += (list.empty() ? "" : ", ") + SqlText(run.uuid.substr(0, 8));
      }
    }
    if (uuids.size() == planners.size()) return "run.planner";
    std::string sql = "CASE";
    for (const auto& [label, list] : uuids) {
      sql += "\n      WHEN substr(run.uuid, 1, 8) IN (" + list + ")\n      THEN " + SqlText(label);
    }
    return sql + " END";
  }
  // The runs of the page with the phase that is drawn of each.
  std::string RunsSql() const {
    return "WITH r AS (\n"
           "  SELECT run.run_id, task.name AS task, task.return_low, task.return_high, run.seed,\n"
           "    run.env_steps_target, " +
           LineOfRun() +
           " AS line,\n"
           "    CASE WHEN EXISTS (SELECT 1 FROM episode e WHERE e.run_id = run.run_id AND e.phase "
           "= "
           "1)\n"
           "      THEN 1 ELSE 2 END AS phase\n"
           "  FROM run JOIN study USING (study_id) JOIN task USING (task_id)\n"
           "  WHERE run.parent_run_id IS NULL AND run.env_steps_target > 0" +
           Chosen("study.name", "task.name", "run.planner", "run.seed") + ")";
  }
  // And their points.
  std::string PointsSql() const {
    return RunsSql() + ", p AS (\n" +
           (Binned()
                ? "  SELECT r.*, b.env_step_bin * 10000 AS env_step, b.sum_return / b.n AS mean\n"
                  "  FROM r JOIN curve_bin b ON b.run_id = r.run_id AND b.phase = r.phase AND b.n "
                  "> "
                  "0)"
                : "  SELECT r.*, e.env_step, avg(e.episode_return) AS mean\n"
                  "  FROM r JOIN episode e ON e.run_id = r.run_id AND e.phase = r.phase\n"
                  "  GROUP BY r.run_id, e.env_step HAVING count(e.episode_return) > 0)");
  }

  static std::vector<std::string> Split(const std::string& text) {
    std::istringstream stream(text);
    std::vector<std::string> lines;
    std::string line;
    while (std::getline(stream, line)) lines.push_back(line);
    return lines;
  }
  void HtmlTable(const Table& table, const std::string& caption) {
    html_ << "<div class=\"wide\"><table><caption>" << Escaped(caption) << "</caption><thead><tr>";
    for (const std::string& column : table.columns) {
      html_ << "<th scope=\"col\">" << Escaped(column) << "</th>";
    }
    html_ << "</tr></thead><tbody>\n";
    for (const auto& row : table.rows) {
      html_ << "<tr>";
      for (const Cell& cell : row) {
        if (const auto* text = std::get_if<std::string>(&cell)) {
          html_ << "<td>" << Escaped(*text) << "</td>";
        } else if (const auto* whole = std::get_if<std::int64_t>(&cell)) {
          html_ << "<td class=\"number\">" << GroupDigits(*whole) << "</td>";
        } else if (const auto* real = std::get_if<double>(&cell)) {
          char number[32];
          std::snprintf(number, sizeof number, "%.4g", *real);
          html_ << "<td class=\"number\">" << number << "</td>";
        } else {
          html_ << "<td></td>";
        }
      }
      html_ << "</tr>\n";
    }
    html_ << "</tbody></table></div>\n";
  }
  // A picture for where there is no scripting, or, `always`, for everyone.
  void Picture(const Figure& figure, const std::string& about, bool always) {
    std::string svg = DrawSvg(figure);
    svg = svg.substr(std::min(svg.find("<svg"), svg.size()));
    const std::size_t end = svg.find('>');
    if (end != std::string::npos && svg.rfind("<svg", 0) == 0) {
      svg.insert(4, " role=\"img\" aria-label=\"" + Escaped(about) + "\"");
    }
    html_ << (always ? "" : "<noscript>") << "<div class=\"static wide\">" << svg << "</div>"
          << (always ? "" : "</noscript>") << "\n";
  }

  void Summary() {
    std::map<std::string, int> by_status;
    for (const RunInfo& run : runs_) ++by_status[RunStatusName(run.status)];
    std::string text = GroupDigits(static_cast<std::int64_t>(runs_.size())) + " runs";
    for (const auto& [status, count] : by_status) {
      text +=
          (status == by_status.begin()->first ? ": " : ", ") + std::to_string(count) + " " + status;
    }
    html_ << "<p>" << Escaped(text) << ".</p>\n";
    const std::vector<std::string> gaps = Gaps(lines_);
    if (gaps.empty()) {
      Note(
          "Nothing is missing: every planner has every seed of every task, and every run "
          "finished.");
      return;
    }
    html_ << "<details open><summary>" << gaps.size()
          << " runs are missing or did not finish</summary><ul>\n";
    for (const std::string& gap : gaps) html_ << "<li>" << Escaped(gap) << "</li>\n";
    html_ << "</ul></details>\n";
  }

  void CurveFigure(const std::string& task, const std::string& title) {
    html_ << "<figure data-task=\"" << task << "\"><h3>" << Escaped(title)
          << "</h3><div class=\"chart\"><canvas tabindex=\"0\" role=\"img\" aria-label=\""
          << "Learning curves, " << Escaped(title)
          << ". Arrow keys read out the points.\"></canvas></div><p class=\"readout\" "
             "aria-live=\"polite\"></p><figcaption class=\"counts\"></figcaption><details "
             "class=\"points wide\"><summary>Points</summary></details></figure>\n";
  }

  void Curves(const CurveRequest& curves) {
    Heading("curves", "Learning curves");
    html_ << "<div class=\"controls\" id=\"controls\" hidden></div>\n";
    std::string note =
        "Evaluation return against environment steps: with the planner where a run has such "
        "evaluations, else with the actor alone. Line: over seeds. Band: minimum to maximum over "
        "seeds; fewer than 3 seeds give points and no band. A line ends where its first seed ends.";
    if (points_ > 1) {
      note += " Each point but the first is the mean of " + std::to_string(points_) +
              " neighbouring " + (Binned() ? "bins of 10,000 steps" : "evaluations") +
              "; the query gives every one.";
    }
    if (databases_.size() > 1) {
      note += " A query is of one database: merge them (`results merge`) to ask it of all runs.";
    }
    Note(note);
    html_ << "<div class=\"grid\">\n";
    std::string last;
    std::size_t index = 0;
    for (const Line& line : lines_) {
      if (line.task == last) continue;
      last = line.task;
      tasks_.push_back(&line);
      CurveFigure(std::to_string(index++), line.task);
    }
    html_ << "</div>\n";
    Picture(CurvesByTask(lines_, curves, CurveInterval::kMinMax), "Learning curves by task", false);
    Query(PointsSql() +
          ", n AS (\n"
          "  SELECT task, line, count(DISTINCT run_id) AS runs FROM p GROUP BY task, line)\n"
          "SELECT task, line, env_step, avg(mean) AS mean, min(mean) AS lo, max(mean) AS hi,\n"
          "  count(*) AS seeds\n"
          "FROM p JOIN n USING (task, line)\n"
          "GROUP BY task, line, env_step HAVING count(*) = runs\n"
          "ORDER BY task, line, env_step");
  }

  void OverTasks(const CurveRequest& curves) {
    if (tasks_.size() < 2) return;
    Heading("tasks", "Mean over tasks");
    Note("Returns are normalised by each task's range. Shown where every seed has every task.");
    CurveFigure("all", "mean over " + std::to_string(tasks_.size()) + " tasks");
    Picture(CurvesOverTasks(lines_, curves), "Mean over tasks", false);
    Query(PointsSql() +
          ", s AS (\n"
          "  SELECT line, seed, env_step,\n"
          "    avg((mean - return_low) / (return_high - return_low)) AS score\n"
          "  FROM p GROUP BY line, seed, env_step HAVING count(*) = " +
          std::to_string(tasks_.size()) +
          "),\nn AS (\n"
          "  SELECT line, count(DISTINCT seed) AS seeds FROM p GROUP BY line)\n"
          "SELECT line, env_step, avg(score) AS mean, min(score) AS lo, max(score) AS hi, seeds\n"
          "FROM s JOIN n USING (line)\n"
          "GROUP BY line, env_step HAVING count(*) = seeds\n"
          "ORDER BY line, env_step");
  }

  void Time() {
    Heading("time", "Time");
    html_ << "<figure><div class=\"chart\"><canvas id=\"time-chart\" role=\"img\" "
             "aria-label=\"Seconds by "
             "planner and activity; the table below has the numbers.\"></canvas></div></figure>\n";
    const Figure figure = TimeByPlanner(databases_, request_.filter);
    Picture(figure, "Seconds by planner and activity", false);
    Table table = {{"planner"}, {}};
    const Panel& panel = figure.panels[0];
    for (std::size_t p = 0; p < panel.categories.size(); ++p) {
      table.rows.push_back({panel.categories[p]});
    }
    time_["planners"] = panel.categories;
    time_["activities"] = ordered_json::array();
    for (std::size_t s = 0; s < panel.series.size(); ++s) {
      const Series& series = panel.series[s];
      table.columns.push_back(figure.legend[s].text);
      ordered_json seconds = ordered_json::array();
      for (std::size_t p = 0; p < series.lo.size(); ++p) {
        table.rows[p].emplace_back(series.hi[p] - series.lo[p]);
        seconds.push_back(Rounded(series.hi[p] - series.lo[p]));
      }
      time_["activities"].push_back({{"name", figure.legend[s].text}, {"seconds", seconds}});
    }
    HtmlTable(table, "Seconds for 1,000 environment steps; n runs");
    Query(RunsSql() +
          ", u AS (\n"
          "  SELECT r.line, r.run_id, t.activity, t.seconds, t.env_step\n"
          "  FROM r JOIN time_use t ON t.run_id = r.run_id AND t.env_step =\n"
          "    (SELECT max(env_step) FROM time_use WHERE run_id = r.run_id)),\n"
          "n AS (\n"
          "  SELECT line, sum(env_step) AS env_steps\n"
          "  FROM (SELECT DISTINCT line, run_id, env_step FROM u) GROUP BY line)\n"
          "SELECT line, activity, 1000 * sum(seconds) / env_steps AS seconds_for_1000_env_steps\n"
          "FROM u JOIN n USING (line) WHERE env_steps > 0 GROUP BY line, activity");
  }

  void Comparisons() {
    Heading("comparison", "Comparison");
    ComparisonRequest request = {.filter = request_.filter, .seed = request_.bootstrap_seed};
    Comparison comparison;
    try {
      comparison = Compare(databases_, request);
    } catch (const Failure& error) {
      if (error.code() != ExitCode::kNotFound) throw;
      Note(std::string("Nothing to compare. ") + error.what());
      return;
    }
    Note(
        "A score is the mean return of the evaluations in the last tenth of the budget, as a share "
        "of the task's range. Intervals: 95 %, stratified bootstrap, " +
        GroupDigits(request.repetitions) + " repetitions, seed " + std::to_string(request.seed) +
        " (Agarwal et al. 2021). Fewer than 3 runs on a task give none.");
    for (const std::string& note : comparison.notes) Note(note);
    HtmlTable(AggregateTable(comparison), "Over " + std::to_string(comparison.tasks.size()) +
                                              (comparison.tasks.size() == 1 ? " task" : " tasks"));
    Picture(IntervalFigure(comparison),
            "Aggregate statistics with intervals; the table has the numbers", true);
    if (comparison.contenders.size() > 1) {
      HtmlTable(ImprovementTable(comparison),
                "Probability that a run of X scores higher than one of Y");
      Picture(ImprovementFigure(comparison),
              "Probability of improvement; the table has the numbers", true);
    }
    Picture(ProfileFigure(comparison), "Performance profiles", true);
    html_ << "<details><summary>Scores by task</summary>\n";
    HtmlTable(ScoreTable(comparison), "Normalised scores");
    html_ << "</details>\n";
    Query(RunsSql() +
          "\nSELECT task, line, seed, avg(episode_return) AS score,\n"
          "  (avg(episode_return) - return_low) / (return_high - return_low) AS normalised\n"
          "FROM r JOIN episode e ON e.run_id = r.run_id AND e.phase = r.phase\n"
          "  AND e.env_step <= env_steps_target AND 10 * e.env_step > 9 * env_steps_target\n"
          "WHERE true" +
          SqlIn("task", comparison.tasks) +
          "\nGROUP BY r.run_id HAVING count(episode_return) > 0\n"
          "ORDER BY task, line, seed");
  }

  void Runs() {
    Heading("runs", "Runs");
    Table table = {{"run", "study", "task", "planner", "model", "seed", "status", "env steps",
                    "budget", "digest"},
                   {}};
    for (const RunInfo& run : runs_) {
      table.rows.push_back({run.uuid.substr(0, 8), run.study, run.task, run.planner, run.model,
                            run.seed, std::string(RunStatusName(run.status)), run.env_steps_done,
                            run.env_steps_target, run.result_digest.substr(0, 12)});
    }
    html_ << "<details><summary>All " << runs_.size() << " runs</summary>\n";
    HtmlTable(table, "Runs by their UUID");
    html_ << "</details>\n";
    Query("SELECT * FROM v_run\nWHERE parent_run_id IS NULL AND env_steps_target > 0" +
          Chosen("study", "task", "planner", "seed"));
  }

  void Settings() {
    Heading("settings", "Settings, programs and machines");
    std::map<std::string, std::pair<std::string, std::set<std::string>>> configs;
    std::map<std::pair<Database*, std::int64_t>, int> builds, plugins;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      auto& [json, users] = configs[runs_[i].config_sha256];
      json = runs_[i].config_json;
      users.insert(runs_[i].planner);
      ++builds[{homes_[i], runs_[i].build_id}];
      for (const auto& id : {runs_[i].env_plugin, runs_[i].model_plugin, runs_[i].planner_plugin}) {
        if (id) ++plugins[{homes_[i], *id}];
      }
    }
    constexpr std::size_t kShown = 8;
    std::size_t shown = 0;
    for (const auto& [sha, entry] : configs) {
      if (++shown > kShown) break;
      std::string users;
      for (const std::string& user : entry.second) users += (users.empty() ? "" : ", ") + user;
      html_ << "<details><summary>Settings " << sha.substr(0, 12) << " (" << Escaped(users)
            << ")</summary><pre>";
      const nlohmann::json parsed = ParseJsonOrDiscard(entry.first);
      const std::string text = parsed.is_discarded() ? entry.first : JsonTextReplacing(parsed, 2);
      for (const std::string& line : Split(text)) html_ << Escaped(line) << "\n";
      html_ << "</pre></details>\n";
    }
    if (configs.size() > kShown) {
      Note("and " + std::to_string(configs.size() - kShown) +
           " more settings; `SELECT * FROM config` lists all.");
    }
    Table programs = {{"version", "commit", "compiler", "instruction set", "libraries", "runs"},
                      {}};
    for (const auto& [key, count] : builds) {
      const BuildInfo build = key.first->GetBuild(key.second);
      programs.rows.push_back({build.version, build.commit + (build.dirty ? " with changes" : ""),
                               build.compiler, build.instruction_set, build.libraries,
                               std::int64_t{count}});
    }
    HtmlTable(programs, "Programs");
    Table modules = {{"name", "version", "SDK", "SHA-256", "runs"}, {}};
    for (const auto& [key, count] : plugins) {
      const PluginInfo plugin = key.first->GetPlugin(key.second);
      modules.rows.push_back({plugin.name, plugin.version, plugin.abi, plugin.sha256.substr(0, 12),
                              std::int64_t{count}});
    }
    HtmlTable(modules, "Plugins");
    Table machines = {{"host", "processor", "cores", "memory, MB", "system", "segments"}, {}};
    std::map<std::vector<Cell>, std::int64_t> segments;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      Statement hosts = homes_[i]->connection().Prepare(
          "SELECT hostname, cpu, cores, memory_bytes / 1000000, os FROM segment JOIN host"
          " USING (host_id) WHERE run_id = ?1");
      hosts.Bind(runs_[i].run_id);
      for (const auto& row : ReadTable(&hosts).rows) ++segments[row];
    }
    for (const auto& [machine, count] : segments) {
      machines.rows.push_back(machine);
      machines.rows.back().emplace_back(count);
    }
    HtmlTable(machines, "Machines");
  }

  // What page.js draws. Text from names cannot end the script element.
  std::string Data(CurveRequest curves) {
    std::map<CurveAxis, std::vector<Line>> others;
    for (const CurveAxis axis : {CurveAxis::kSeconds, CurveAxis::kTransitions}) {
      curves.axis = axis;
      others[axis] = ReadLines(databases_, curves);
      Thin(points_, &others[axis]);
    }
    const auto spent = [&](CurveAxis axis, const Line& line, std::size_t run) -> ordered_json {
      for (const Line& other : others[axis]) {
        if (other.task != line.task || other.label != line.label || other.published) continue;
        ordered_json xs = ordered_json::array();
        for (const double x : other.runs[run].x) xs.push_back(Rounded(x));
        return xs;
      }
      return nullptr;
    };

    ordered_json data;
    // The order of the static pictures: the paper's planners, then published lines.
    std::vector<const Line*> sorted;
    for (const Line& line : lines_) sorted.push_back(&line);
    std::stable_sort(sorted.begin(), sorted.end(), [](const Line* a, const Line* b) {
      if (a->published != b->published) return b->published;
      if (a->planner != b->planner) return PlannerBefore(a->planner, b->planner);
      return a->label < b->label;
    });
    std::vector<std::string> labels;
    for (const Line* line : sorted) {
      if (std::find(labels.begin(), labels.end(), line->label) == labels.end()) {
        labels.push_back(line->label);
      }
    }
    data["labels"] = labels;
    std::set<std::int64_t> seeds;
    data["tasks"] = ordered_json::array();
    std::map<std::string, std::size_t> task_index;
    for (const Line* first : tasks_) {
      task_index[first->task] = task_index.size();
      ordered_json task = {{"name", first->task}, {"low", nullptr}, {"high", nullptr}};
      for (const Line& line : lines_) {
        if (line.task != first->task || !line.return_low || !line.return_high) continue;
        task["low"] = *line.return_low;
        task["high"] = *line.return_high;
      }
      data["tasks"].push_back(std::move(task));
    }
    data["lines"] = ordered_json::array();
    for (const Line& line : lines_) {
      std::set<std::int64_t> steps;
      for (const RunCurve& run : line.runs) steps.insert(run.env_step.begin(), run.env_step.end());
      const std::vector<std::int64_t> grid(steps.begin(), steps.end());
      ordered_json item;
      item["task"] = task_index[line.task];
      item["label"] = std::find(labels.begin(), labels.end(), line.label) - labels.begin();
      if (line.published) item["published"] = true;
      item["steps"] = grid;
      item["runs"] = ordered_json::array();
      for (std::size_t r = 0; r < line.runs.size(); ++r) {
        const RunCurve& run = line.runs[r];
        if (!line.published) seeds.insert(run.seed);
        // Values on the grid; null where this run has none.
        const auto on_grid = [&](const ordered_json& values) {
          ordered_json cells = ordered_json::array();
          std::size_t i = 0;
          for (const std::int64_t step : grid) {
            const bool there = i < run.env_step.size() && run.env_step[i] == step;
            cells.push_back(there && i < values.size() ? values[i] : ordered_json(nullptr));
            if (there) ++i;
          }
          return cells;
        };
        ordered_json values = ordered_json::array();
        for (const double value : run.value) values.push_back(Rounded(value));
        ordered_json entry = {{"seed", run.seed}, {"y", on_grid(values)}};
        if (!line.published) {
          entry["s"] = on_grid(spent(CurveAxis::kSeconds, line, r));
          entry["m"] = on_grid(spent(CurveAxis::kTransitions, line, r));
        }
        item["runs"].push_back(std::move(entry));
      }
      data["lines"].push_back(std::move(item));
    }
    data["seeds"] = seeds;
    data["time"] = time_;
    std::string json;
    for (const char c : JsonTextReplacing(data)) {
      if (c == '<') {
        json += "\\u003c";
      } else {
        json += c;
      }
    }
    return json;
  }

  const std::vector<std::unique_ptr<Database>>& databases_;
  const ReportRequest& request_;
  std::vector<Line> lines_;
  std::vector<const Line*> tasks_;  // the first line of each task
  std::vector<RunInfo> runs_;
  std::vector<Database*> homes_;  // of runs_
  std::size_t points_ = 1;
  ordered_json time_;
  std::ostringstream html_;
};

}  // namespace

std::string ReportPage(const std::vector<std::unique_ptr<Database>>& databases,
                       const ReportRequest& request) {
  if (ChartLibrary().empty()) {
    throw Failure(ExitCode::kInternal,
                  "this build has no plotting library for the report. Install the package "
                  "libjs-chart.js and build again.");
  }
  return Page(databases, request).Make();
}

}  // namespace dreamsearch::results
