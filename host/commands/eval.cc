// runner eval [RUN] - how good is an agent under this planner and that model?
#include <cmath>
#include <iostream>
#include <map>

#include "host/acting/episode.h"
#include "host/commands/commands.h"
#include "host/commands/progress.h"
#include "host/flags/flags.h"
#include "host/flags/run_flags.h"
#include "host/processes/supervisor.h"
#include "host/sweeps/evaluations.h"
#include "host/sweeps/probe.h"
#include "host/sweeps/sweep.h"
#include "host/sweeps/trained_run.h"
#include "host/sweeps/working_database.h"
#include "results/statistics/statistics.h"
#include "results/system/error.h"
#include "results/text/table.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// Sums over the episodes of one task, planner and model.
struct Figures {
  std::vector<double> returns;
  double decisions = 0, plan_us = 0, transitions = 0;
  std::size_t runs = 0, finished = 0;
  std::map<std::string, std::vector<double>> rankings;  // of each run, by the metric's name
};

// Metrics of an evaluation and what the table calls them.
constexpr std::pair<const char*, const char*> kRankingColumns[] = {
    {"ranking.correlation", "rank correlation"},
    {"ranking.first_visits", "first visits"},
    {"ranking.regret", "regret"},
    {"ranking.spread", "spread"}};

void PrintTable(results::Database* database, const std::vector<RunSpec>& specs, bool ranked) {
  std::vector<std::vector<std::string>> order;
  std::map<std::vector<std::string>, Figures> table;
  for (const RunSpec& spec : specs) {
    const std::vector<std::string> key = {spec.environment.task(), spec.planner.name(),
                                          spec.model.name()};
    const auto [entry, added] = table.try_emplace(key);
    if (added) order.push_back(key);
    Figures& figures = entry->second;
    ++figures.runs;
    const auto run = database->FindRun(KeyOf(spec));
    if (!run) continue;
    if (run->status == results::RunStatus::kFinished) ++figures.finished;
    for (const auto& [metric, title] : kRankingColumns) {
      const std::optional<double> value = database->LastScalar(run->run_id, metric);
      if (value) figures.rankings[metric].push_back(*value);
    }
    for (const results::EpisodeInfo& episode : database->ListEpisodes(run->run_id)) {
      const double decisions = std::ceil(static_cast<double>(episode.length) /
                                         static_cast<double>(spec.action_repeat()));
      figures.decisions += decisions;
      figures.plan_us += decisions * episode.plan_us_mean;
      figures.transitions += static_cast<double>(episode.model_transitions);
      if (episode.episode_return) figures.returns.push_back(*episode.episode_return);
    }
  }
  results::Table text = {{"task", "planner", "model", "episodes", "return", "std. error",
                          "ms/decision", "transitions/decision"},
                         {}};
  for (const auto& [metric, title] : kRankingColumns) {
    if (ranked) text.columns.emplace_back(title);
  }
  for (const auto& key : order) {
    Figures& figures = table[key];
    const std::size_t n = figures.returns.size();
    std::vector<results::Cell> row(key.begin(), key.end());
    row.push_back(std::to_string(n));
    row.push_back(n == 0 ? "-" : FormatNumber("%.1f", Mean(figures.returns)));
    const std::optional<double> error = results::SampleOf(figures.returns).StandardError();
    row.push_back(error ? FormatNumber("%.1f", *error) : "-");
    row.push_back(figures.decisions == 0
                      ? "-"
                      : FormatNumber("%.3f", figures.plan_us / figures.decisions / 1000));
    row.push_back(figures.decisions == 0
                      ? "-"
                      : FormatNumber("%.1f", figures.transitions / figures.decisions));
    for (const auto& [metric, title] : kRankingColumns) {
      const std::vector<double>& values = figures.rankings[metric];
      if (ranked) row.push_back(values.empty() ? "-" : FormatNumber("%.3f", Mean(values)));
    }
    if (figures.finished < figures.runs) row.emplace_back(std::string("unfinished"));
    text.rows.push_back(std::move(row));
  }
  std::cout << text.Print(results::TableForm::kText);
}

struct Eval {
  EvaluationOptions evaluation;

  CommandSpec Declare() { return EvaluationFlags(&evaluation); }
  int Run(const Words& words);
};

int Eval::Run(const Words& words) {
  CompleteEvaluation(&evaluation);
  const RunOptions& options = evaluation.choice;
  ProgressDisplay progress;
  WorkingDatabase working(options.process, /*exists=*/!evaluation.run.empty(), &progress);
  std::unique_ptr<results::Database> database;
  std::vector<RunSpec> specs;
  std::string trained_name;
  std::map<std::string, std::string> ingredients;  // of the trained run
  if (!evaluation.run.empty()) {
    database = results::Database::OpenExisting(working.path());
    working.TakeToRead(evaluation.run);
    const TrainedRun trained =
        FindTrainedRun(database.get(), evaluation.run, options.process.trusted());
    for (const std::string& warning : trained.warnings) {
      std::cerr << "warning: " << warning << "\n";
    }
    specs = EvaluationsOf(trained, options);
    trained_name = RunName(trained);
    ingredients = trained.ingredients;
    std::cerr << RunName(trained) << " after " << GroupDigits(trained.env_step)
              << " environment steps of training\n";
  } else {
    const Catalogue catalogue = ScanPlugins(options.process.plugin_path);
    specs = EvaluationsWithoutTraining(options, catalogue);
  }
  for (RunSpec& spec : specs) {
    if (spec.planner.Has(kSearches)) spec.evaluation->ranks = evaluation.ranks;
  }
  const SweepFigures figures = ProbeSweep(&specs, options.process);
  const std::vector<results::TaskInfo>& tasks = figures.tasks;
  for (const std::string& notice : figures.notices) std::cerr << "note: " << notice << "\n";
  const std::string changed =
      ingredients.empty() ? "" : IngredientChange(specs.front().environment, ingredients);
  if (!changed.empty()) {
    std::cerr << "warning: " << trained_name << " was trained in another world: " << changed
              << "\n";
  }
  if (database == nullptr) database = results::Database::OpenOrCreate(working.path());
  for (const std::string& warning : database->warnings()) {
    std::cerr << "warning: " << warning << "\n";
  }
  for (std::size_t i = 0; i < specs.size(); ++i) {
    specs[i].evaluation->episode_steps = static_cast<std::uint64_t>(tasks[i].episode_steps);
  }

  const std::vector<PlannedRun> planned = PlanSweep(database.get(), options.process, specs);
  std::size_t finished = 0;
  const int failed_before = SaySkipped(database.get(), planned);
  for (const PlannedRun& run : planned) {
    if (run.action == SweepAction::kSkipFinished) ++finished;
  }
  std::vector<std::string> argv = {"runner", "eval"};
  argv.insert(argv.end(), words.begin(), words.end());
  std::vector<SweepJob> jobs = RecordSweep(database.get(), options.process, planned, tasks, argv);
  for (SweepJob& job : jobs) job.memory_bytes = figures.memory_bytes;
  std::cerr << Counted(specs.size(), "evaluation") << ": " << jobs.size() << " to play, "
            << finished << " finished before; database " << working.Name() << std::endl;
  const SweepResult result =
      RunSweep(database.get(), options.process, std::move(jobs), working.observer());
  PrintTable(database.get(), specs, evaluation.ranks.every > 0);
  database.reset();
  working.Finish();
  if (result.exit_status == static_cast<int>(ExitCode::kInterrupted) ||
      std::find(result.statuses.begin(), result.statuses.end(), results::RunStatus::kInterrupted) !=
          result.statuses.end()) {
    std::cerr << "the same command resumes\n";
  }
  const int status = SweepStatus(planned, result);
  return status != 0 ? status : failed_before;
}

}  // namespace

Command EvalCommand() { return MakeCommand<Eval>(); }

}  // namespace dreamsearch
