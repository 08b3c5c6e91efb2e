// results curves - learning curves as pictures and tables.
#include <iostream>

#include "results/figures/curve_figure.h"
#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

constexpr std::int64_t kMostSmooth = 999;

}  // namespace

int CurvesCommand(const Words& words) {
  Arguments arguments(
      "curves", "[options]",
      "Draws learning curves: a panel a task, a line a planner, the mean over seeds against\n"
      "environment steps. Evaluations are those with the planner where a run has them, else those\n"
      "with the actor alone; the legend says which, and how many seeds.");
  arguments.AddDatabase();
  arguments.AddFilter();
  namespace po = boost::program_options;
  arguments.Add()("out", po::value<std::vector<std::string>>()->value_name("FILE"),
                  "picture (.svg, .png, .pdf) or table of its numbers (.csv, .json, .md, .txt); "
                  "may be given several times (default: curves.svg)")(
      "kind", po::value<std::string>()->default_value("tasks"),
      "tasks: a panel a task; mean: the mean over tasks; time: seconds by planner and activity")(
      "phase", po::value<std::string>()->default_value("evaluation"),
      "evaluation, training (0), search (1) or actor (2)")(
      "x", po::value<std::string>()->default_value("steps"), "steps, seconds or transitions")(
      "interval", po::value<std::string>()->default_value("minmax"),
      "round the mean of 3 seeds or more: minmax, t95 (95 %, Student's t) or none")(
      "smooth", po::value<std::string>()->default_value("1"),
      "centred moving mean of so many points, an odd number, said on the axis; 1: none")(
      "log-x", "a logarithmic x axis")(
      "published", po::value<std::vector<std::string>>()->value_name("LIST"),
      "imported curves to draw beside: methods, as METHOD or METHOD/OBS, or all; the x axis "
      "ends with our runs, with --log-x it has all of them")(
      "title", po::value<std::string>()->default_value(""), "a title");
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);
  std::vector<std::string> outs = {"curves.svg"};
  if (arguments.Has("out")) outs = arguments.Get<std::vector<std::string>>("out");

  const Selection selection = arguments.GetSelection();
  CurveRequest request;
  request.filter = selection.filter;
  request.phase = ParseCurvePhase(arguments.Get<std::string>("phase"));
  request.axis = ParseCurveAxis(arguments.Get<std::string>("x"));
  request.log_x = arguments.Has("log-x");
  const std::int64_t smooth = ParseNumber(arguments.Get<std::string>("smooth"), "--smooth", 1);
  if (smooth % 2 == 0 || smooth > kMostSmooth) {
    throw Failure(ExitCode::kUsage, "--smooth: expected an odd number of points from 1 to " +
                                        std::to_string(kMostSmooth) +
                                        ", as many on either side of each, found " +
                                        std::to_string(smooth));
  }
  request.smooth = static_cast<int>(smooth);
  request.published = arguments.List("published");
  const CurveInterval interval = ParseCurveInterval(arguments.Get<std::string>("interval"));
  const std::string kind = arguments.Get<std::string>("kind");
  if (kind != "tasks" && kind != "mean" && kind != "time") {
    throw Failure(ExitCode::kUsage, "no kind '" + kind + "'. Known: tasks, mean, time");
  }
  if (!request.published.empty() && request.axis != CurveAxis::kSteps) {
    throw Failure(ExitCode::kUsage,
                  "--published curves are known by environment steps only; use --x steps");
  }

  const auto databases = OpenSelected(selection);
  CheckPublished(databases, request.published);
  const std::vector<Line> lines = ReadLines(databases, request);
  if (lines.empty())
    throw Failure(ExitCode::kNotFound, NothingToGroup(databases, selection.filter));
  const std::vector<TimeUse> time =
      kind == "time" ? ReadTimeUse(databases, selection.filter) : std::vector<TimeUse>();
  Figure figure = kind == "tasks"  ? CurvesByTask(lines, request, interval)
                  : kind == "mean" ? CurvesOverTasks(lines, request)
                                   : TimeByPlanner(time);
  figure.title = arguments.Get<std::string>("title");
  for (const std::string& out : outs) {
    if (IsTablePath(out)) {
      PrintTable(kind == "tasks"  ? CurveTable(lines)
                 : kind == "mean" ? OverTasksTable(lines)
                                  : TimeTable(time),
                 "text", out);
      continue;
    }
    Draw(figure, out);
    std::cerr << "wrote " << AbsolutePath(out) << "\n";
  }
  for (const std::string& gap : MissingOrUnfinished(lines))
    std::cerr << "note: " << Printable(gap) << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch::results
