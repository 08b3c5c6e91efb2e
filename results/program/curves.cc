// results curves - how do returns grow with steps, seconds or model transitions?
#include <iostream>

#include "results/analysis/common_steps.h"
#include "results/figures/curve_figure.h"
#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

constexpr std::uint64_t kMostSmooth = 999;

int ParseSmooth(const std::string& text) {
  const std::uint64_t points = ParseWhole(text, 1, kMostSmooth);
  if (points % 2 == 0) {
    throw std::invalid_argument("expected an odd number, for as many points on either side");
  }
  return static_cast<int>(points);
}

struct Curves {
  Selection selection;
  CurveRequest request;
  CurveInterval interval = CurveInterval::kMinMax;
  std::string kind = "tasks", title;
  std::vector<std::string> outs;

  CommandSpec Declare() {
    return {
        .name = "results curves",
        .summary = "draws learning curves as pictures and writes their numbers as tables",
        .examples =
            {"results curves --out curves.svg",
             "results curves --env walker_walk --smooth 5 --out walker.png --out walker.csv"},
        .about =
            "A panel shows a task, a line shows the mean over a planner's seeds against "
            "environment steps. Where a run was evaluated with search, the line shows those "
            "evaluations, otherwise those with the actor alone; the legend says which, and "
            "how many seeds there are.",
        .groups = {
            SelectionFlags(&selection),
            {"What to draw",
             {{"kind", "KIND", OneOf(&kind, {"tasks", "mean", "time"}),
               "a panel for each task, the mean over tasks, or the seconds by planner and "
               "activity"},
              {"phase", "PHASE", OneOf(&request.phase, PhaseChoices()), "which episodes"},
              {"x", "AXIS",
               OneOf(&request.axis, Choices<CurveAxis>{{"steps", CurveAxis::kSteps},
                                                       {"seconds", CurveAxis::kSeconds},
                                                       {"transitions", CurveAxis::kTransitions},
                                                       {"compute", CurveAxis::kCompute}}),
               "the x axis; compute: core-minutes at 60 GFLOP/s"},
              {"log-x", "", Switch(&request.log_x), "make the x axis logarithmic"},
              {"interval", "INTERVAL",
               OneOf(&interval, Choices<CurveInterval>{{"minmax", CurveInterval::kMinMax},
                                                       {"t95", CurveInterval::kT95},
                                                       {"none", CurveInterval::kNone}}),
               "what to draw round the mean of 3 seeds or more; t95 is the 95 % interval of "
               "Student's t"},
              {"smooth", "N", Parsed(&request.smooth, ParseSmooth).Default("1"),
               "draw the centred moving mean of N points, an odd number; the axis says so"},
              PublishedFlag(&request.published),
              {"title", "TEXT", Text(&title), "the picture's title"}}},
            {"Where to",
             {{"out", "FILE", Texts(&outs).Default("curves.svg"),
               "write a picture (.svg, .png, .pdf) or the numbers (.csv, .json, .md, .txt)"}}}}};
  }
  int Run();
};

int Curves::Run() {
  request.filter = selection.filter;
  if (outs.empty()) outs = {"curves.svg"};
  if (!request.published.empty() && request.axis != CurveAxis::kSteps) {
    throw Failure(ExitCode::kUsage,
                  "results curves: --published: expected --x steps, because published curves are "
                  "known by environment steps only");
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
  figure.title = title;
  for (const std::string& out : outs) {
    if (FormOfTablePath(out)) {
      PrintTable(kind == "tasks"  ? CurveTable(lines)
                 : kind == "mean" ? OverTasksTable(lines)
                                  : TimeTable(time),
                 TableForm::kText, out);
      continue;
    }
    Draw(figure, out);
    std::cerr << "wrote " << AbsolutePath(out) << "\n";
  }
  std::vector<std::string> notes = NotesOfRuns(lines);
  bool interpolated = false;
  for (const TaskMean& mean : kind == "mean" ? MeansOverTasks(lines) : std::vector<TaskMean>()) {
    if (!mean.left_out.empty()) notes.push_back(mean.left_out);
    interpolated = interpolated || (mean.left_out.empty() && mean.interpolated);
  }
  for (const Line& line : kind == "tasks" ? lines : std::vector<Line>()) {
    interpolated = interpolated || StepsOf({&line}).spacing() > 0;
  }
  if (interpolated) notes.push_back(kInterpolatedNote);
  for (const std::string& note : notes) std::cerr << "note: " << Printable(note) << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command CurvesCommand() { return MakeCommand<Curves>(); }

}  // namespace dreamsearch::results
