#include "results/analysis/curves.h"

#include <gtest/gtest.h>

#include <cmath>

#include "results/analysis/comparison.h"
#include "results/analysis/line_statistics.h"
#include "results/analysis/time_use.h"
#include "results/figures/curve_figure.h"
#include "tests/results/analysis/curves_fixture.h"

namespace dreamsearch::results {
namespace {

TEST_F(CurvesTest, APointIsTheMeanOverSeedsAtTheEvaluationsOwnStep) {
  AddRun({.seed = 0}, {{kSearch, 0, 1}, {kSearch, 1200, 2}, {kSearch, 1200, 4}});
  AddRun({.seed = 1}, {{kSearch, 0, 3}, {kSearch, 1200, 9}});
  const std::vector<Line> lines = ReadLines(databases_, {});
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].n(), 2);
  const std::vector<LinePoint> points = Points(lines[0]);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].env_step, 1200);
  EXPECT_EQ(points[1].mean, 6);  // of 3 and 9
  EXPECT_EQ(points[1].lo, 3);
  EXPECT_EQ(points[1].hi, 9);
}

TEST_F(CurvesTest, LongBudgetsAreReadFromTheBins) {
  AddRun({.env_steps_target = 200000},
         {{kSearch, 10000, 1}, {kSearch, 10001, 2}, {kSearch, 20000, 4}});
  const std::vector<LinePoint> points = Points(ReadLines(databases_, {})[0]);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].env_step, 10000);
  EXPECT_EQ(points[1].env_step, 20000);
  EXPECT_EQ(points[1].mean, 3);
}

TEST_F(CurvesTest, EvaluationIsWithSearchWhereThereIsOne) {
  AddRun({.planner = "mcts_pw"}, {{kSearch, 0, 1}, {kActor, 0, 5}});
  AddRun({.planner = "dreamer"}, {{kActor, 0, 7}});
  AddRun({.planner = "random"}, {{kSearch, 0, 3}});
  const std::vector<Line> lines = ReadLines(databases_, {});
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[2].acting, "");  // neither searches nor has an actor
  EXPECT_EQ(lines[0].acting, " with search");
  EXPECT_EQ(Points(lines[0])[0].mean, 1);
  EXPECT_EQ(lines[1].label, "dreamer");
  EXPECT_EQ(lines[1].acting, " actor");
  EXPECT_EQ(Points(lines[1])[0].mean, 7);
  EXPECT_EQ(Points(ReadLines(databases_, {.phase = CurvePhase::kActorEvaluation})[0])[0].mean, 5);
}

TEST_F(CurvesTest, PlannersStandInTheOrderOfTheirFirstRunsWhateverIsChosen) {
  for (const char* planner : {"rollout", "zebra", "cem"}) {
    AddRun({.planner = planner, .seed = 1}, {{kSearch, 0, 1}});
  }
  AddRun({.task = "cup_catch", .planner = "zebra"}, {{kSearch, 0, 1}});
  AddRun({.task = "cup_catch", .planner = "rollout"}, {{kSearch, 0, 1}});
  const std::vector<RunGroup> all = GroupRuns(databases_, {}, CurvePhase::kEvaluation);
  EXPECT_EQ(OrderedLabels(all), (std::vector<std::string>{"rollout", "zebra", "cem"}));
  const std::vector<RunGroup> some =
      GroupRuns(databases_, {.tasks = {"cup_catch"}}, CurvePhase::kEvaluation);
  EXPECT_EQ(OrderedLabels(some), (std::vector<std::string>{"rollout", "zebra"}));
}

TEST_F(CurvesTest, OtherSettingsAreOtherLinesNamedByTheDifference) {
  AddRun({.config = R"({"mcts_pw":{"depth":3},"steps":5})"}, {{kSearch, 0, 1}});
  AddRun({.config = R"({"mcts_pw":{"depth":4},"steps":5})"}, {{kSearch, 0, 1}});
  const std::vector<Line> lines = ReadLines(databases_, {});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].label, "mcts_pw mcts_pw.depth=3");
  EXPECT_EQ(lines[1].label, "mcts_pw mcts_pw.depth=4");
}

// Models have other settings; the model's name says so.
TEST_F(CurvesTest, RunsOnAnotherModelAreToldApartByItsNameAlone) {
  AddRun({.config = R"({"model":{"width":3},"depth":5})"}, {{kSearch, 0, 1}});
  AddRun({.model = "tdmpc", .config = R"({"model":{"bins":7},"depth":5})"}, {{kSearch, 0, 1}});
  AddRun({.model = "tdmpc", .config = R"({"model":{"bins":9},"depth":5})"}, {{kSearch, 0, 1}});
  EXPECT_EQ(OrderedLabels(GroupRuns(databases_, {}, CurvePhase::kEvaluation)),
            (std::vector<std::string>{"mcts_pw on dreamer", "mcts_pw on tdmpc model.bins=7",
                                      "mcts_pw on tdmpc model.bins=9"}));
}

// An ablation tried on one task only must not make the others incomparable.
TEST_F(CurvesTest, ASettingTriedOnOneTaskNamesTheRunsOfAllTasks) {
  const std::string plain = R"({"mcts_pw":{"depth":3},"steps":5})";
  AddRun({.task = "walker_walk", .config = plain}, {{kSearch, 95000, 100}});
  AddRun({.task = "walker_walk", .config = R"({"mcts_pw":{"depth":4},"steps":5})"},
         {{kSearch, 95000, 100}});
  // Budgets differ between the tasks, but on none of them.
  AddRun({.task = "cup_catch", .config = R"({"mcts_pw":{"depth":3},"steps":7})"},
         {{kSearch, 95000, 300}});
  AddRun({.task = "cup_catch", .planner = "rollout", .config = plain}, {{kSearch, 95000, 300}});
  const std::vector<RunGroup> groups = GroupRuns(databases_, {}, CurvePhase::kEvaluation);
  EXPECT_EQ(
      OrderedLabels(groups),
      (std::vector<std::string>{"mcts_pw mcts_pw.depth=3", "mcts_pw mcts_pw.depth=4", "rollout"}));
  const Figure figure =
      CurvesOverTasks(ReadLines(databases_, {.filter = {.planners = {"mcts_pw"}}}), {});
  ASSERT_EQ(figure.legend.size(), 1u);
  EXPECT_EQ(figure.legend[0].text, "mcts_pw mcts_pw.depth=3 with search (n = 1)");
}

TEST_F(CurvesTest, ASettingThatOneRunLacksNamesTheOther) {
  AddRun({.config = R"({"a":1,"b":2})"}, {{kSearch, 0, 1}});
  AddRun({.config = R"({"a":1})"}, {{kSearch, 0, 1}});
  // Nothing to tell these apart by.
  AddRun({.planner = "rollout", .config = "{"}, {{kSearch, 0, 1}});
  AddRun({.planner = "rollout", .config = "["}, {{kSearch, 0, 1}});
  const std::vector<std::string> labels =
      OrderedLabels(GroupRuns(databases_, {}, CurvePhase::kEvaluation));
  ASSERT_EQ(labels.size(), 4u);
  EXPECT_EQ(labels[0], "mcts_pw");
  EXPECT_EQ(labels[1], "mcts_pw b=2");
  EXPECT_EQ(labels[2].substr(0, 15), "rollout config ");
  EXPECT_EQ(labels[3].substr(0, 15), "rollout config ");
}

// As an evaluation of a changed world beside one of the world as it was.
TEST_F(CurvesTest, SettingsThatOneRunHasNoneOfNameTheOther) {
  AddRun({.config = R"({"environment":{"parameters":{}}})"}, {{kSearch, 0, 1}});
  AddRun({.config = R"({"environment":{"parameters":{"mass_scale":2}}})"}, {{kSearch, 0, 1}});
  EXPECT_EQ(OrderedLabels(GroupRuns(databases_, {}, CurvePhase::kEvaluation)),
            (std::vector<std::string>{"mcts_pw", "mcts_pw environment.parameters.mass_scale=2"}));
}

TEST_F(CurvesTest, OtherVersionsOfAPluginAreOtherLinesAndOtherContenders) {
  AddRun({.seed = 0, .planner_version = "1.0.0"}, {{kSearch, 95000, 100}});
  AddRun({.seed = 1, .planner_version = "1.0.0"}, {{kSearch, 95000, 100}});
  AddRun({.seed = 2, .planner_version = "2.0.0"}, {{kSearch, 95000, 300}});
  const std::vector<Line> lines = ReadLines(databases_, {});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].label, "mcts_pw planner.version=\"1.0.0\"");
  EXPECT_EQ(lines[0].n(), 2);
  EXPECT_EQ(Points(lines[0])[0].mean, 100);
  EXPECT_EQ(lines[1].label, "mcts_pw planner.version=\"2.0.0\"");
  EXPECT_EQ(Points(lines[1])[0].mean, 300);
  const Comparison comparison = Compare(databases_, {});
  ASSERT_EQ(comparison.contenders.size(), 2u);
  EXPECT_EQ(comparison.contenders[1].label, lines[1].label);
  EXPECT_EQ(comparison.contenders[1].scores, (Scores{{0.3}}));
  const std::vector<TimeUse> uses = ReadTimeUse(databases_, {});
  ASSERT_EQ(uses.size(), 2u);
  EXPECT_EQ(uses[0].label, lines[0].label);
}

// Or a mean over tasks would be of one version on this task and of another on that.
TEST_F(CurvesTest, AVersionUsedOnOneTaskOnlyNamesTheRunsOfAllTasks) {
  AddRun({.task = "walker_walk", .planner_version = "1.0.0"}, {{kSearch, 0, 1}});
  AddRun({.task = "cup_catch", .planner_version = "2.0.0"}, {{kSearch, 0, 1}});
  EXPECT_EQ(OrderedLabels(GroupRuns(databases_, {}, CurvePhase::kEvaluation)).size(), 2u);
}

TEST_F(CurvesTest, ASeedThatAnotherVersionHasIsNotMissing) {
  AddRun({.seed = 0, .planner_version = "1.0.0"}, {{kSearch, 0, 1}});
  AddRun({.seed = 1, .planner_version = "2.0.0"}, {{kSearch, 0, 1}});
  AddRun({.planner = "rollout", .seed = 2}, {{kSearch, 0, 1}});
  EXPECT_EQ(MissingOrUnfinished(ReadLines(databases_, {.filter = {.planners = {"mcts_pw"}}})),
            (std::vector<std::string>{"walker_walk, mcts_pw: seed 2 is missing."}));
}

TEST_F(CurvesTest, BuildsOfOneVersionAreOneLineThatSaysHowMany) {
  AddRun({.seed = 0, .planner_version = "1.0.0", .planner_sha256 = "1111111111"},
         {{kSearch, 0, 100}});
  AddRun({.seed = 1, .planner_version = "1.0.0", .planner_sha256 = "2222222222"},
         {{kSearch, 0, 300}});
  // Of one build itself, but of the same line as the others.
  AddRun({.task = "cup_catch", .planner_version = "1.0.0", .planner_sha256 = "1111111111"},
         {{kSearch, 0, 1}});
  AddRun({.planner = "rollout", .planner_version = "1.0.0", .planner_sha256 = "3333333333"},
         {{kSearch, 0, 1}});
  EXPECT_EQ(OrderedLabels(GroupRuns(databases_, {}, CurvePhase::kEvaluation)),
            (std::vector<std::string>{"mcts_pw (2 builds)", "rollout"}));
  const std::vector<Line> lines = ReadLines(databases_, {.filter = {.tasks = {"walker_walk"}}});
  ASSERT_EQ(lines[0].label, "mcts_pw (2 builds)");
  EXPECT_EQ(Points(lines[0])[0].mean, 200);

  std::vector<const RunInfo*> runs;
  const std::vector<RunInfo> all = databases_[0]->ListRuns();
  for (const RunInfo& run : all) runs.push_back(&run);
  EXPECT_EQ(SettingLabels(runs, Apart::kBuilds),
            (std::vector<std::string>{"planner.build=\"11111111\"", "planner.build=\"22222222\"",
                                      "planner.build=\"11111111\"", ""}));
  EXPECT_EQ(SettingLabels(runs, Apart::kVersions), (std::vector<std::string>(4)));
}

TEST_F(CurvesTest, EvaluationsAloneAreSaidToBeThere) {
  EXPECT_NE(NothingToGroup(databases_, {}).find("no run matches"), std::string::npos);
  AddRun({.env_steps_target = 0}, {{kSearch, 0, 1}});
  EXPECT_TRUE(GroupRuns(databases_, {}, CurvePhase::kEvaluation).empty());
  EXPECT_NE(NothingToGroup(databases_, {}).find("Found 1 evaluation."), std::string::npos);
}

TEST_F(CurvesTest, SecondsLeaveEvaluationOutAndAreInterpolated) {
  AddRun({}, {{kTrain, 1000, 0}, {kTrain, 2000, 0}, {kSearch, 1500, 3}});
  const Line line = ReadLines(databases_, {.axis = CurveAxis::kSeconds})[0];
  ASSERT_EQ(line.runs[0].x.size(), 1u);
  EXPECT_DOUBLE_EQ(line.runs[0].x[0], 15);
}

TEST_F(CurvesTest, ComputeIsCoreMinutesAtSixtyGflopASecond) {
  AddRun({}, {{kTrain, 1000, 0}, {kTrain, 2000, 0}, {kSearch, 2000, 3}});
  // 20 s of wall time: 40 processor seconds, and 2,400 GFLOP, on which a core that computes 60 a
  // second would work for 40 s.
  const Line line = ReadLines(databases_, {.axis = CurveAxis::kCompute})[0];
  ASSERT_EQ(line.runs[0].x.size(), 1u);
  EXPECT_DOUBLE_EQ(line.runs[0].x[0], 40.0 / 60);
}

TEST_F(CurvesTest, ARunWithoutProcessorTimeIsLeftOutOfTheComputeAxisAndSaidSo) {
  AddRun({}, {{kTrain, 1000, 0}, {kSearch, 1000, 3}});
  databases_[0]->connection().Execute("UPDATE time_use SET gflop = NULL");
  const std::vector<Line> lines = ReadLines(databases_, {.axis = CurveAxis::kCompute});
  EXPECT_TRUE(lines[0].runs[0].x.empty());
  ASSERT_EQ(lines[0].missing.size(), 1u);
  EXPECT_NE(lines[0].missing[0].find("seed 0 is left out"), std::string::npos);
  EXPECT_EQ(ReadLines(databases_, {})[0].runs[0].x.size(), 1u);
}

TEST_F(CurvesTest, TransitionsAreThoseOfTrainingSoFar) {
  AddRun({}, {{kTrain, 1000, 0}, {kTrain, 2000, 0}, {kSearch, 2000, 3}});
  EXPECT_DOUBLE_EQ(ReadLines(databases_, {.axis = CurveAxis::kTransitions})[0].runs[0].x[0], 20);
}

TEST_F(CurvesTest, SmoothingIsACentredMeanSaidOnTheAxis) {
  AddRun({}, {{kSearch, 0, 0}, {kSearch, 1, 3}, {kSearch, 2, 9}, {kSearch, 3, 3}});
  const CurveRequest request = {.smooth = 3};
  const std::vector<Line> lines = ReadLines(databases_, request);
  EXPECT_EQ(lines[0].runs[0].value, (std::vector<double>{0, 4, 5, 3}));
  EXPECT_NE(CurvesByTask(lines, request, CurveInterval::kMinMax).y_label.find("smoothed over 3"),
            std::string::npos);
}

TEST_F(CurvesTest, ARunInTwoDatabasesCountsOnce) {
  AddRun({}, {{kSearch, 0, 1}});
  databases_.push_back(Database::OpenReadOnly(folder_ / "r.db"));
  EXPECT_EQ(ReadLines(databases_, {})[0].n(), 1);
}

TEST_F(CurvesTest, TheLegendSaysHowManySeedsAndTheNotesWhatIsMissing) {
  AddRun({.seed = 0}, {{kSearch, 0, 1}});
  AddRun({.seed = 1}, {{kSearch, 0, 1}}, RunStatus::kCrashed);
  AddRun({.planner = "rollout", .seed = 0}, {{kSearch, 0, 1}});
  const std::vector<Line> lines = ReadLines(databases_, {});
  const Figure figure = CurvesByTask(lines, {}, CurveInterval::kMinMax);
  ASSERT_EQ(figure.legend.size(), 2u);
  EXPECT_EQ(figure.legend[0].text, "mcts_pw with search (n = 2)");
  EXPECT_EQ(figure.legend[1].text, "rollout with search (n = 1)");
  EXPECT_EQ(MissingOrUnfinished(lines),
            (std::vector<std::string>{"walker_walk, mcts_pw: seed 1 crashed at 0 of 100,000 steps.",
                                      "walker_walk, rollout: seed 1 is missing."}));
}

TEST_F(CurvesTest, SeedsThatStoppedAlikeAreNamedInOneSentence) {
  AddRun({.seed = 0}, {{kSearch, 0, 1}}, RunStatus::kCrashed);
  AddRun({.seed = 1}, {{kSearch, 0, 1}}, RunStatus::kInterrupted);
  AddRun({.seed = 2}, {{kSearch, 0, 1}}, RunStatus::kCrashed);
  EXPECT_EQ(MissingOrUnfinished(ReadLines(databases_, {})),
            (std::vector<std::string>{
                "walker_walk, mcts_pw: seeds 0, 2 crashed at 0 of 100,000 steps.",
                "walker_walk, mcts_pw: seed 1 interrupted at 0 of 100,000 steps."}));
}

bool HasBand(const Figure& figure) {
  for (const Series& series : figure.panels[0].series) {
    if (series.mark == Series::Mark::kBand) return true;
  }
  return false;
}

TEST_F(CurvesTest, FewerThanThreeSeedsGiveNoInterval) {
  AddRun({.seed = 0}, {{kSearch, 0, 1}, {kSearch, 10, 2}});
  AddRun({.seed = 1}, {{kSearch, 0, 2}, {kSearch, 10, 3}});
  EXPECT_FALSE(HasBand(CurvesByTask(ReadLines(databases_, {}), {}, CurveInterval::kMinMax)));
  AddRun({.seed = 2}, {{kSearch, 0, 2}, {kSearch, 10, 3}});
  EXPECT_TRUE(HasBand(CurvesByTask(ReadLines(databases_, {}), {}, CurveInterval::kMinMax)));
  EXPECT_FALSE(HasBand(CurvesByTask(ReadLines(databases_, {}), {}, CurveInterval::kNone)));
}

TEST_F(CurvesTest, TheIntervalIsStudentsForAnyNumberOfSeeds) {
  for (const int n : {3, 31, 32, 100}) {
    LinePoint point;
    point.n = n;
    double squares = 0;
    for (int i = 0; i < n; ++i) {
      point.values.push_back(i % 2);
      point.mean += point.values.back() / n;
    }
    for (const double value : point.values) squares += (value - point.mean) * (value - point.mean);
    const std::optional<Interval> interval = IntervalOf(point, CurveInterval::kT95);
    ASSERT_TRUE(interval);
    const double half = StudentQuantile(0.975, n - 1) * std::sqrt(squares / (n - 1) / n);
    EXPECT_DOUBLE_EQ(interval->hi, point.mean + half);
    EXPECT_DOUBLE_EQ(interval->lo, point.mean - half);
  }
}

// A mean over fewer seeds at the end would jump; the seeds go on by themselves.
TEST_F(CurvesTest, TheMeanEndsWhereTheFirstSeedEnds) {
  AddRun({.seed = 0}, {{kSearch, 0, 1}, {kSearch, 10, 2}, {kSearch, 20, 100}});
  AddRun({.seed = 1}, {{kSearch, 0, 1}, {kSearch, 10, 4}});
  const Figure figure = CurvesByTask(ReadLines(databases_, {}), {}, CurveInterval::kMinMax);
  for (const Series& series : figure.panels[0].series) {
    if (series.mark == Series::Mark::kLine) {
      EXPECT_EQ(series.y, (std::vector<double>{1, 3}));
    }
    if (series.mark == Series::Mark::kThin) {
      EXPECT_EQ(series.y, (std::vector<double>{2, 100}));
    }
  }
}

TEST_F(CurvesTest, TimeKeepsApartWhatCurvesKeepApart) {
  AddRun({.config = R"({"depth":3})"}, {{kTrain, 1000, 1}});
  AddRun({.config = R"({"depth":4})"}, {{kTrain, 1000, 1}});
  const Figure figure = TimeByPlanner(ReadTimeUse(databases_, {}));
  EXPECT_EQ(figure.panels[0].categories,
            (std::vector<std::string>{"mcts_pw depth=3 (n = 1)", "mcts_pw depth=4 (n = 1)"}));
  const Table table = TimeTable(ReadTimeUse(databases_, {}));
  ASSERT_EQ(table.rows.size(), 4u);
  EXPECT_EQ(table.rows[0], (std::vector<Cell>{std::string("mcts_pw depth=3"), std::int64_t{1},
                                              std::string("learning"), 10.0}));
}

TEST_F(CurvesTest, TheTableOfTheMeanOverTasksIsWhatIsDrawn) {
  for (int seed = 0; seed < 3; ++seed) {
    AddRun({.task = "walker_walk", .seed = seed}, {{kSearch, 0, 100.0 * seed}});
    AddRun({.task = "cup_catch", .seed = seed}, {{kSearch, 0, 300}, {kSearch, 10, 300}});
  }
  const std::vector<Line> lines = ReadLines(databases_, {});
  const Table table = OverTasksTable(lines);
  ASSERT_EQ(table.rows.size(), 1u);  // at step 10 a task has no point
  EXPECT_DOUBLE_EQ(std::get<double>(table.rows[0][3]), 0.2);
  EXPECT_DOUBLE_EQ(std::get<double>(table.rows[0][4]), 0.15);
  EXPECT_DOUBLE_EQ(std::get<double>(table.rows[0][5]), 0.25);
  EXPECT_EQ(std::get<std::int64_t>(table.rows[0][6]), 3);
  const Figure figure = CurvesOverTasks(lines, {});
  for (const Series& series : figure.panels[0].series) {
    if (series.mark == Series::Mark::kLine) {
      EXPECT_EQ(series.y, (std::vector<double>{std::get<double>(table.rows[0][3])}));
    }
  }
}

TEST(RunGroups, AShortLabelHasTheSettingsOwnNames) {
  EXPECT_EQ(ShortLabel("mcts_pw model.parameters.norm=\"a.b\" run.steps=0.5 (study.x=1)"),
            "mcts_pw norm=\"a.b\" steps=0.5 (study.x=1)");
  EXPECT_EQ(ShortLabel("a.lr=1 b.lr=2 c.d=3"), "a.lr=1 b.lr=2 d=3");
}

}  // namespace
}  // namespace dreamsearch::results
