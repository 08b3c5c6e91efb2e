// results compare - which planner is better over tasks and seeds, and how sure is that?
#include <iostream>

#include "results/analysis/comparison.h"
#include "results/figures/comparison_figure.h"
#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/text.h"

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
  if (comparison.contenders.size() > 1) {
    text += "\n" + heading(
                       "Contrasts (two planners match if the interval of their difference lies "
                       "within 0.05 of 0; costs in core-minutes, without evaluation)");
    text += ContrastTable(comparison).Print(form);
  }
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

struct CompareRuns {
  Selection selection;
  ComparisonRequest request;
  TableForm form = TableForm::kText;
  std::string figure = "intervals";
  std::vector<std::string> outs;

  CommandSpec Declare() {
    return {
        .name = "results compare",
        .summary = "compares planners over tasks and seeds, with 95 % intervals",
        .examples = {"results compare", "results compare --at 60000 --out intervals.svg"},
        .about =
            "Compares the planners on the tasks that all of them have: mean, median, "
            "interquartile mean, optimality gap and probability of improvement of normalised "
            "scores, with intervals of a stratified bootstrap (Agarwal et al. 2021).",
        .groups = {
            SelectionFlags(&selection),
            {"What to compare",
             {{"phase", "PHASE", OneOf(&request.phase, PhaseChoices()), "which episodes"},
              {"at", "N", Whole(&request.at, 0).Default("0, the end of each run's budget"),
               "take the score at this many environment steps"},
              BootstrapSeedFlag(&request.seed),
              {"repetitions", "N", Whole(&request.repetitions, 100, 10000000),
               "repetitions of the bootstrap"}}},
            {"How",
             {FormFlag(&form),
              {"figure", "FIGURE",
               OneOf(&figure, {"intervals", "profiles", "improvement", "efficiency"}),
               "what a picture shows"},
              {"out", "FILE", Texts(&outs),
               "write a picture (.svg, .png, .pdf) or the tables (.txt, .md, .csv, .json); csv has "
               "the score of each run"}}}}};
  }
  int Run();
};

int CompareRuns::Run() {
  request.filter = selection.filter;
  const auto databases = OpenSelected(selection);
  const Comparison comparison = Compare(databases, request);
  const auto document = [&](TableForm wanted) {
    if (wanted == TableForm::kJson) return ComparisonJson(comparison, request);
    if (wanted == TableForm::kCsv) return Csv(comparison);
    return Document(comparison, request, wanted);
  };
  if (outs.empty()) {
    std::cout << document(form);
    return static_cast<int>(ExitCode::kOk);
  }
  for (const std::string& out : outs) {
    if (const std::optional<TableForm> table = FormOfTablePath(out)) {
      WriteFile(out, document(*table));
    } else {
      Draw(figure == "intervals"     ? IntervalFigure(comparison)
           : figure == "profiles"    ? ProfileFigure(comparison)
           : figure == "improvement" ? ImprovementFigure(comparison)
                                     : EfficiencyFigure(ComputeEfficiency(databases, request)),
           out);
    }
    std::cerr << "wrote " << AbsolutePath(out) << "\n";
  }
  for (const std::string& note : comparison.notes) std::cerr << "note: " << Printable(note) << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command CompareCommand() { return MakeCommand<CompareRuns>(); }

}  // namespace dreamsearch::results
