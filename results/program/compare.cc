// results compare - statistics over tasks and seeds.
#include <iostream>

#include "results/analysis/comparison.h"
#include "results/figures/comparison_figure.h"
#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

std::string Document(const Comparison& comparison, const ComparisonRequest& request,
                     TableForm form) {
  const bool markdown = form == TableForm::kMarkdown;
  const auto heading = [&](const std::string& text) {
    return markdown ? "## " + text + "\n\n" : text + "\n\n";
  };
  std::string text;
  text += heading("Scores: mean evaluation return over the last tenth " +
                  (request.at > 0 ? "before step " + GroupDigits(request.at) : "of the budget") +
                  ", normalised");
  text += ScoreTable(comparison).Print(form) + "\n";
  text += heading("Over " + std::to_string(comparison.tasks.size()) +
                  (comparison.tasks.size() == 1 ? " task" : " tasks") + ", with 95 % intervals (" +
                  GroupDigits(request.repetitions) + " bootstrap repetitions, seed " +
                  std::to_string(request.seed) + ")");
  text += AggregateTable(comparison).Print(form) + "\n";
  text += heading("Probability of improvement");
  text += ImprovementTable(comparison).Print(form);
  if (!comparison.notes.empty()) {
    text += "\n" + heading("Notes");
    for (const std::string& note : comparison.notes) {
      text += (markdown ? "- " : "  ") + Printable(note) + "\n";
    }
  }
  return text;
}

std::string Csv(const Comparison& comparison) {
  Table table = {{"task", "planner", "run", "score"}, {}};
  for (std::size_t t = 0; t < comparison.tasks.size(); ++t) {
    for (const Contender& contender : comparison.contenders) {
      for (std::size_t r = 0; r < contender.scores[t].size(); ++r) {
        table.rows.push_back({comparison.tasks[t], contender.label, static_cast<std::int64_t>(r),
                              contender.scores[t][r]});
      }
    }
  }
  return table.Print(TableForm::kCsv);
}

}  // namespace

int CompareCommand(const Words& words) {
  Arguments arguments(
      "compare", "[options]",
      "Compares planners on the tasks that all of them have: mean, median, interquartile mean,\n"
      "optimality gap and probability of improvement on normalised scores, with 95 % intervals of\n"
      "a stratified bootstrap (Agarwal et al. 2021).");
  arguments.AddDatabase();
  arguments.AddFilter();
  namespace po = boost::program_options;
  arguments.Add()("phase", po::value<std::string>()->default_value("evaluation"),
                  "evaluation, training (0), search (1) or actor (2)")(
      "at", po::value<std::string>()->default_value("0"),
      "score at so many environment steps; 0: at the end of each run's budget")(
      "bootstrap-seed", po::value<std::string>()->default_value("0"),
      "equal seeds give equal intervals, to the byte")(
      "repetitions", po::value<std::string>()->default_value(std::to_string(kBootstrapRepetitions)),
      "of the bootstrap")("format", po::value<std::string>()->default_value("text"),
                          "text, markdown, csv (the single scores) or json")(
      "figure", po::value<std::string>()->default_value("intervals"),
      "for --out FILE.svg, .png, .pdf: intervals, profiles, improvement or efficiency")(
      "out", po::value<std::vector<std::string>>()->value_name("FILE"),
      "picture (.svg, .png, .pdf) or tables (.txt, .md, .csv, .json); several times");
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);

  const Selection selection = arguments.GetSelection();
  ComparisonRequest request;
  request.filter = selection.filter;
  request.phase = ParseCurvePhase(arguments.Get<std::string>("phase"));
  request.at = ParseNumber(arguments.Get<std::string>("at"), "--at", 0);
  request.seed = static_cast<std::uint64_t>(
      ParseNumber(arguments.Get<std::string>("bootstrap-seed"), "--bootstrap-seed", 0));
  const std::int64_t repetitions =
      ParseNumber(arguments.Get<std::string>("repetitions"), "--repetitions", 100);
  if (repetitions > 10000000) {
    throw Failure(ExitCode::kUsage,
                  "--repetitions: expected at most 10000000, found " + std::to_string(repetitions));
  }
  request.repetitions = static_cast<int>(repetitions);
  const TableForm form = ParseTableForm(arguments.Get<std::string>("format"));
  const std::string kind = arguments.Get<std::string>("figure");
  if (kind != "intervals" && kind != "profiles" && kind != "improvement" && kind != "efficiency") {
    throw Failure(ExitCode::kUsage,
                  "no figure '" + kind + "'. Known: intervals, profiles, improvement, efficiency");
  }

  const auto databases = OpenSelected(selection);
  const Comparison comparison = Compare(databases, request);
  const auto document = [&](TableForm wanted) {
    if (wanted == TableForm::kJson) return ComparisonJson(comparison, request);
    if (wanted == TableForm::kCsv) return Csv(comparison);
    return Document(comparison, request, wanted);
  };
  if (!arguments.Has("out")) {
    std::cout << document(form);
    return static_cast<int>(ExitCode::kOk);
  }
  for (const std::string& out : arguments.Get<std::vector<std::string>>("out")) {
    if (IsTablePath(out)) {
      WriteFile(out, document(FormOfTablePath(out)));
    } else {
      Draw(kind == "intervals"     ? IntervalFigure(comparison)
           : kind == "profiles"    ? ProfileFigure(comparison)
           : kind == "improvement" ? ImprovementFigure(comparison)
                                   : EfficiencyFigure(ComputeEfficiency(databases, request)),
           out);
    }
    std::cerr << "wrote " << AbsolutePath(out) << "\n";
  }
  for (const std::string& note : comparison.notes) std::cerr << "note: " << Printable(note) << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch::results
