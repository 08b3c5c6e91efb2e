#include "results/report/report.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "results/analysis/common_steps.h"
#include "results/analysis/line_statistics.h"
#include "results/analysis/time_use.h"
#include "results/database/query.h"
#include "results/database/schema.h"
#include "results/figures/comparison_figure.h"
#include "results/figures/curve_figure.h"
#include "results/report/html.h"
#include "results/report/page/embedded.h"
#include "results/report/report_data.h"
#include "results/report/report_queries.h"
#include "results/report/strip.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/json_text.h"
#include "results/text/text.h"
#include "results/text/web_page.h"

namespace dreamsearch::results {
namespace {

// Of a run in a chart; more than a screen shows.
constexpr std::size_t kMostPoints = 40;
constexpr std::size_t kConfigsShown = 8;

std::string Listed(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::string StudyNames(const std::vector<GroupedRun>& runs) {
  std::set<std::string> names;
  for (const GroupedRun& item : runs) names.insert(item.run.study);
  return Listed(names);
}

std::string Summary(const std::vector<GroupedRun>& runs, const std::vector<Line>& lines) {
  std::map<std::string, int> by_status;
  for (const GroupedRun& item : runs) ++by_status[RunStatusName(item.run.status)];
  std::string text = Counted(runs.size(), "run");
  for (const auto& [status, count] : by_status) {
    text +=
        (status == by_status.begin()->first ? ": " : ", ") + std::to_string(count) + " " + status;
  }
  std::string html = "<p>" + HtmlText(text) + ".</p>\n";
  for (const GroupedRun& item : runs) {
    for (const std::string& note : item.notes) html += Note(note);
  }
  const std::vector<std::string> gaps = MissingOrUnfinished(lines);
  if (gaps.empty()) {
    return html + Note(
                      "Nothing is missing: every planner has every seed of every task, and every "
                      "run finished.");
  }
  html += "<details open><summary>Runs that are missing or did not finish</summary><ul>\n";
  for (const std::string& gap : gaps) html += "<li>" + HtmlText(gap) + "</li>\n";
  return html + "</ul></details>\n";
}

// How the points of the curves came about.
std::string CurveNotes(std::size_t group, bool binned, bool interpolated, std::size_t databases) {
  std::string note;
  if (interpolated) note += std::string(kInterpolatedNote) + " ";
  if (group > 1) {
    note += "Each point but the first is the mean of " + std::to_string(group) + " neighbouring " +
            (binned ? "bins of 10,000 steps" : "evaluations") +
            (interpolated ? ", or where the steps of seeds differ one of so many" : "") +
            "; the query gives every one. ";
  }
  if (databases > 1) {
    note += "A query is of one database: merge them (`results merge`) to ask it of all runs.";
  }
  return HtmlText(note);
}

// Empty for fewer than two tasks.
std::string OverTasks(const std::vector<Line>& lines, const CurveRequest& request,
                      const ReportQueries& queries) {
  if (TasksOf(lines).size() < 2) return "";
  std::string html =
      "<h2 id=\"tasks\">Mean over tasks</h2>\n" +
      Note(
          "Returns are normalised by each task's range. Shown where every seed has every task. "
          "The interquartile mean is that over all seeds and tasks.");
  for (const TaskMean& mean : MeansOverTasks(lines)) {
    if (!mean.left_out.empty()) html += Note(mean.left_out);
  }
  return html + "<div class=\"interactive\" id=\"over-tasks-chart\"></div>\n" +
         PictureWithoutScript(CurvesOverTasks(lines, request), "Mean over tasks") +
         Query(queries.OverTasks());
}

// A row a planner, a column an activity.
Table TimeByActivity(const std::vector<TimeUse>& uses) {
  Table table = {{"planner", "runs"}, {}};
  for (const char* activity : kActivities) table.columns.emplace_back(activity);
  for (const TimeUse& use : uses) {
    auto& row = table.rows.emplace_back();
    row = {use.label, use.runs};
    for (const char* activity : kActivities) row.emplace_back(use.SecondsFor1000Steps(activity));
  }
  return table;
}

std::string Comparisons(const std::vector<std::unique_ptr<Database>>& databases,
                        const ReportRequest& report, const ReportQueries& queries) {
  const ComparisonRequest request = {.filter = report.filter, .seed = report.bootstrap_seed};
  Comparison comparison;
  try {
    comparison = Compare(databases, request);
  } catch (const Failure& error) {
    if (error.code() != ExitCode::kNotFound) throw;
    return Note(std::string("Nothing to compare. ") + error.what());
  }
  std::string html = Note(
      "A score is the mean return of the evaluations in the last tenth of the budget, as a share "
      "of the task's range. Intervals: 95 %, stratified bootstrap, " +
      GroupDigits(request.repetitions) + " repetitions, seed " + std::to_string(request.seed) +
      " (Agarwal et al. 2021). Fewer than 3 runs on a task give none.");
  for (const std::string& note : comparison.notes) html += Note(note);
  html += HtmlTable(AggregateTable(comparison), "Over " + Counted(comparison.tasks.size(), "task"));
  html += Picture(IntervalFigure(comparison),
                  "Aggregate statistics with intervals; the table has the numbers");
  if (comparison.contenders.size() > 1) {
    html += HtmlTable(ImprovementTable(comparison),
                      "Probability that a run of X scores higher than one of Y");
    html += Picture(ImprovementFigure(comparison),
                    "Probability of improvement; the table has the numbers");
    html +=
        HtmlTable(ContrastTable(comparison),
                  "Differences of normalised scores and of their spreads over seeds, and ratios of "
                  "costs in core-minutes; two planners match if the interval of their difference "
                  "lies within 0.05 of 0");
  }
  html += Picture(ProfileFigure(comparison), "Performance profiles");
  html += Folded("Scores by task", HtmlTable(ScoreTable(comparison), "Normalised scores"));
  return html + Query(queries.Scores(comparison.tasks));
}

std::string Runs(const std::vector<GroupedRun>& runs, const ReportQueries& queries) {
  Table table = {{"run", "study", "task", "planner", "model", "seed", "status", "env steps",
                  "budget", "digest"},
                 {}};
  for (const GroupedRun& item : runs) {
    const RunInfo& run = item.run;
    table.rows.push_back({run.uuid.substr(0, 8), run.study, run.task, run.planner, run.model,
                          run.seed, std::string(RunStatusName(run.status)), run.env_steps_done,
                          run.env_steps_target, run.result_digest.substr(0, 12)});
  }
  return Folded("All " + Counted(runs.size(), "run"), HtmlTable(table, "Runs by their UUID")) +
         Query(queries.Runs());
}

// What the agents do: of each planner on each task the first run that keeps a strip.
std::string Strips(const std::vector<GroupedRun>& runs) {
  constexpr std::size_t kMostShown = 40;
  std::set<std::vector<std::string>> seen;
  std::string html;
  std::size_t shown = 0, more = 0;
  for (const GroupedRun& item : runs) {
    const RunInfo& run = item.run;
    const std::filesystem::path file =
        std::filesystem::path(item.database->RunFolder(run)) / kStripFile;
    std::error_code error;
    const auto bytes = std::filesystem::file_size(file, error);
    if (error || bytes > kMostStripBytes || !std::filesystem::is_regular_file(file)) continue;
    if (!seen.insert({run.task, run.planner, run.model}).second) continue;
    if (++shown > kMostShown) {
      ++more;
      continue;
    }
    const std::string png = ReadWholeFile(file);
    if (!png.starts_with("\x89PNG\r\n")) continue;
    html += PngPicture(png, run.task + ", " + run.planner + " on " + run.model + ", seed " +
                                std::to_string(run.seed) +
                                ": an evaluation episode from beginning to end");
  }
  if (shown == 0) {
    return Note("No run keeps pictures of an episode; `runner render RUN --strip` makes them.");
  }
  if (more > 0) html += Note("and " + std::to_string(more) + " more that keep pictures.");
  return html;
}

std::string Configurations(const std::vector<GroupedRun>& runs) {
  std::map<std::string, std::pair<std::string, std::set<std::string>>> configs;
  for (const GroupedRun& item : runs) {
    auto& [json, users] = configs[item.run.config_sha256];
    json = item.run.config_json;
    users.insert(item.run.planner);
  }
  std::string html;
  std::size_t shown = 0;
  for (const auto& [sha, entry] : configs) {
    if (++shown > kConfigsShown) break;
    const nlohmann::json parsed = ParseJsonOrDiscard(entry.first);
    html +=
        Folded("Settings " + sha.substr(0, 12) + " (" + Listed(entry.second) + ")",
               Preformatted(parsed.is_discarded() ? entry.first : JsonTextReplacing(parsed, 2)));
  }
  if (configs.size() > kConfigsShown) {
    html += Note("and " + std::to_string(configs.size() - kConfigsShown) +
                 " more settings; `SELECT * FROM config` lists all.");
  }
  return html;
}

std::string Provenance(const std::vector<GroupedRun>& runs) {
  std::map<std::pair<Database*, std::int64_t>, std::int64_t> builds, plugins;
  std::map<std::vector<Cell>, std::int64_t> segments;  // by machine
  for (const auto& [run, database, phase, notes] : runs) {
    ++builds[{database, run.build_id}];
    for (const auto& id : {run.env_plugin, run.model_plugin, run.planner_plugin}) {
      if (id) ++plugins[{database, *id}];
    }
    Statement hosts = database->connection().Prepare(
        "SELECT hostname, cpu, cores, memory_bytes / 1000000, os FROM segment JOIN host"
        " USING (host_id) WHERE run_id = ?1");
    hosts.Bind(run.run_id);
    for (const auto& row : ReadTable(&hosts).rows) ++segments[row];
  }
  Table programs = {{"version", "commit", "compiler", "instruction set", "libraries", "runs"}, {}};
  for (const auto& [key, count] : builds) {
    const BuildInfo build = key.first->GetBuild(key.second);
    programs.rows.push_back({build.version, build.commit + (build.dirty ? " with changes" : ""),
                             build.compiler, build.instruction_set, build.libraries, count});
  }
  Table modules = {{"name", "version", "SDK", "SHA-256", "runs"}, {}};
  for (const auto& [key, count] : plugins) {
    const PluginRow plugin = key.first->GetPlugin(key.second);
    modules.rows.push_back(
        {plugin.name, plugin.version, plugin.abi, plugin.sha256.substr(0, 12), count});
  }
  Table machines = {{"host", "processor", "cores", "memory, MB", "system", "segments"}, {}};
  for (const auto& [machine, count] : segments) {
    machines.rows.push_back(machine);
    machines.rows.back().emplace_back(count);
  }
  return HtmlTable(programs, "Programs") + HtmlTable(modules, "Plugins") +
         HtmlTable(machines, "Machines");
}

}  // namespace

std::string ReportPage(const std::vector<std::unique_ptr<Database>>& databases,
                       const ReportRequest& request) {
  if (ChartLibrary().empty()) {
    throw Failure(ExitCode::kInternal,
                  "this build has no plotting library for the report. Install the package "
                  "libjs-chart.js and build again.");
  }
  CurveRequest curves = {.filter = request.filter, .published = request.published};
  std::vector<AxisLines> axes = {{CurveAxis::kSteps, "steps", "steps", {}},
                                 {CurveAxis::kTransitions, "transitions", "model transitions", {}},
                                 {CurveAxis::kSeconds, "seconds", "seconds", {}},
                                 {CurveAxis::kCompute, "compute", "core-minutes", {}}};
  std::size_t group = 1;
  for (AxisLines& axis : axes) {
    curves.axis = axis.axis;
    axis.lines = ReadLines(databases, curves);
    group = Thin(kMostPoints, &axis.lines);
  }
  curves.axis = CurveAxis::kSteps;
  const std::vector<Line>& lines = axes.front().lines;
  if (lines.empty()) {
    throw Failure(ExitCode::kNotFound, NothingToGroup(databases, request.filter));
  }
  const bool binned =
      std::any_of(lines.begin(), lines.end(), [](const Line& line) { return line.binned; });
  const bool interpolated = std::any_of(
      lines.begin(), lines.end(), [](const Line& line) { return StepsOf({&line}).spacing() > 0; });
  const std::vector<GroupedRun> runs = TrainedRuns(databases, request.filter);
  const std::vector<TimeUse> time = ReadTimeUse(databases, request.filter);
  const ReportQueries queries(request.filter, lines);
  return FillTemplate(
      ReportTemplate(),
      {
          {"title",
           HtmlText(request.title.empty() ? "Results: " + StudyNames(runs) : request.title)},
          {"style", std::string(ReportStyle())},
          {"summary", Summary(runs, lines)},
          {"curve_notes", CurveNotes(group, binned, interpolated, databases.size())},
          {"curve_picture",
           PictureWithoutScript(CurvesByTask(lines, curves, CurveInterval::kMinMax),
                                "Learning curves by task")},
          {"curve_query", Query(queries.Curves())},
          {"over_tasks", OverTasks(lines, curves, queries)},
          {"time_picture",
           PictureWithoutScript(TimeByPlanner(time), "Seconds by planner and activity")},
          {"time_table", HtmlTable(TimeByActivity(time), "Seconds for 1,000 environment steps")},
          {"time_query", Query(queries.Time())},
          {"comparison", Comparisons(databases, request, queries)},
          {"strips", Strips(runs)},
          {"runs", Runs(runs, queries)},
          {"settings", Configurations(runs) + Provenance(runs)},
          {"data", ScriptJson(ReportData(axes, time))},
          {"chart_library", std::string(ChartLibrary())},
          {"script", std::string(ReportScript())},
      });
}

}  // namespace dreamsearch::results
