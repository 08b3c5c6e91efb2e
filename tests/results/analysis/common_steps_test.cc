// What a mean over seeds is where their steps differ, and that it is the same everywhere.
#include "results/analysis/common_steps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "results/analysis/efficiency.h"
#include "results/analysis/line_statistics.h"
#include "results/analysis/published.h"
#include "results/database/query.h"
#include "results/figures/curve_figure.h"
#include "results/report/page/embedded.h"
#include "results/report/report.h"
#include "results/report/report_data.h"
#include "results/report/report_queries.h"
#include "tests/results/analysis/curves_fixture.h"

namespace dreamsearch::results {
namespace {

class CommonStepsTest : public CurvesTest {
 protected:
  // Evaluations on a straight line, so that every interpolated value is known: slope times
  // env_step.
  void AddStraight(const std::string& task, std::int64_t seed, double slope,
                   const std::vector<std::int64_t>& steps) {
    std::vector<Value> values = {{kTrain, 100000, 0}};
    for (const std::int64_t step : steps) {
      values.push_back({kSearch, step, slope * static_cast<double>(step)});
    }
    AddRun({.task = task, .seed = seed}, values);
  }
  // As in episodes that end early: no step but the first in common.
  void AddVaried(const std::string& task) {
    AddStraight(task, 0, 1, {0, 130, 310, 520, 690});
    AddStraight(task, 1, 2, {0, 170, 290, 480, 720});
    AddStraight(task, 2, 6, {0, 110, 330, 505, 700});
  }
  static std::vector<std::int64_t> StepsOfPoints(const std::vector<LinePoint>& points) {
    std::vector<std::int64_t> steps;
    for (const LinePoint& point : points) steps.push_back(point.env_step);
    return steps;
  }
};

TEST_F(CommonStepsTest, SeedsAtOtherStepsAreAveragedOnAGrid) {
  AddVaried("walker_walk");
  const LineCurve curve = CurveOf(ReadLines(databases_, {})[0]);
  EXPECT_TRUE(curve.interpolated);
  EXPECT_EQ(StepsOfPoints(curve.points),
            (std::vector<std::int64_t>{0, 100, 200, 300, 400, 500, 600, 690}));
  for (const LinePoint& point : curve.points) {
    const auto step = static_cast<double>(point.env_step);
    EXPECT_EQ(point.n, 3);
    EXPECT_EQ(point.x, step);
    EXPECT_NEAR(point.mean, 3 * step, 1e-9);
    EXPECT_NEAR(point.lo, step, 1e-9);
    EXPECT_NEAR(point.hi, 6 * step, 1e-9);
  }
}

TEST_F(CommonStepsTest, NoSeedHasAValueBeyondItsLastPointOrBeforeItsFirst) {
  AddStraight("walker_walk", 0, 1, {0, 100, 300});
  AddStraight("walker_walk", 1, 3, {50, 150, 250, 350, 450});
  const Line line = ReadLines(databases_, {})[0];
  const std::vector<LinePoint> points = Points(line);
  for (const LinePoint& point : points) {
    const bool both = point.env_step >= 50 && point.env_step <= 300;
    EXPECT_EQ(point.n, both ? 2 : 1) << point.env_step;
    const double slope = both ? 2 : point.env_step < 50 ? 1 : 3;
    EXPECT_NEAR(point.mean, slope * static_cast<double>(point.env_step), 1e-9);
  }
  EXPECT_EQ(points.front().env_step, 0);
  EXPECT_EQ(points.back().env_step, 450);
  const LineCurve curve = CurveOf(line);
  EXPECT_EQ(curve.points.front().env_step, 50);
  EXPECT_EQ(curve.points.back().env_step, 300);
  // The other goes on by itself, from where the mean ends.
  ASSERT_EQ(curve.tails.size(), 1u);
  EXPECT_EQ(curve.tails[0].env_step, (std::vector<std::int64_t>{300, 350, 450}));
  EXPECT_NEAR(curve.tails[0].value[0], 900, 1e-9);
}

TEST_F(CommonStepsTest, AnEvaluationThatWasNotFiniteIsNotBridged) {
  AddStraight("walker_walk", 0, 1, {0, 100, 200, 300, 400});
  AddRun({.seed = 1}, {{kSearch, 0, 0},
                       {kSearch, 110, 330},
                       {kSearch, 190, std::nan("")},
                       {kSearch, 310, 930},
                       {kSearch, 400, 1200}});
  for (const LinePoint& point : Points(ReadLines(databases_, {})[0])) {
    const bool hole = point.env_step > 110 && point.env_step < 310;
    EXPECT_EQ(point.n, hole ? 1 : 2) << point.env_step;
    EXPECT_NEAR(point.mean, (hole ? 1 : 2) * static_cast<double>(point.env_step), 1e-9);
  }
}

TEST_F(CommonStepsTest, SeedsAtTheSameStepsAreNotInterpolated) {
  AddRun({.seed = 0}, {{kSearch, 0, 0.1}, {kSearch, 10, 0.2}, {kSearch, 25, 0.3}});
  AddRun({.seed = 1}, {{kSearch, 0, 0.4}, {kSearch, 10, std::nan("")}, {kSearch, 25, 0.7}});
  AddRun({.seed = 2}, {{kSearch, 0, 0.5}, {kSearch, 10, 0.6}});  // not as far
  const Line line = ReadLines(databases_, {})[0];
  EXPECT_FALSE(CurveOf(line).interpolated);
  const std::vector<LinePoint> points = Points(line);
  EXPECT_EQ(StepsOfPoints(points), (std::vector<std::int64_t>{0, 10, 25}));
  EXPECT_EQ(points[0].mean, (0.1 + 0.4 + 0.5) / 3);
  EXPECT_EQ(points[1].values, (std::vector<double>{0.2, 0.6}));
  EXPECT_EQ(points[2].values, (std::vector<double>{0.3, 0.7}));
}

TEST_F(CommonStepsTest, OneSeedKeepsItsSteps) {
  AddStraight("walker_walk", 0, 1, {0, 7, 1000, 1001});
  EXPECT_EQ(StepsOfPoints(CurveOf(ReadLines(databases_, {})[0]).points),
            (std::vector<std::int64_t>{0, 7, 1000, 1001}));
}

TEST_F(CommonStepsTest, SeedsWithoutAStepInCommonHaveNoMean) {
  AddStraight("walker_walk", 0, 1, {0, 10});
  AddStraight("walker_walk", 1, 1, {20, 30});
  const LineCurve curve = CurveOf(ReadLines(databases_, {})[0]);
  EXPECT_TRUE(curve.points.empty());
  EXPECT_EQ(curve.tails.size(), 2u);
}

TEST_F(CommonStepsTest, AFineClusterInALongRangeMakesNoHugeGrid) {
  RunCurve a, b;
  a.evaluated = a.env_step = {0, 1, 2, 3, 4, std::int64_t{1} << 53};
  b.evaluated = b.env_step = {0, 1, 2, 3, 5, std::int64_t{1} << 53};
  const CommonSteps common({&a, &b});
  EXPECT_GT(common.spacing(), 0);
  EXPECT_LT(common.steps().size(), 30u);
}

TEST_F(CommonStepsTest, PublishedSeedsAtOtherStepsAreAllInTheMean) {
  MakeRun(databases_[0].get());
  std::vector<PublishedPoint> points;
  for (std::int64_t seed = 0; seed < 10; ++seed) {
    for (std::int64_t i = 1; i <= 50; ++i) {
      const std::int64_t step = 1000 * i + 37 * seed * (i % 3);
      points.push_back({.source = "s",
                        .method = "d4pg",
                        .obs = "state",
                        .task = "walker_walk",
                        .env_steps = step,
                        .seed = seed,
                        .episode_return = static_cast<double>(step * seed)});
    }
  }
  StorePublished(databases_[0].get(), points);
  const std::vector<Line> lines = ReadLines(databases_, {.published = {"d4pg"}});
  ASSERT_EQ(lines.size(), 2u);
  const LineCurve curve = CurveOf(lines[1]);
  ASSERT_GT(curve.points.size(), 40u);
  for (const LinePoint& point : curve.points) {
    EXPECT_EQ(point.n, 10);
    EXPECT_NEAR(point.mean, 4.5 * static_cast<double>(point.env_step), 1e-6);
  }
}

TEST_F(CommonStepsTest, TasksAtOtherStepsHaveAMeanOverTasks) {
  AddVaried("walker_walk");
  AddVaried("cup_catch");
  for (int seed = 0; seed < 3; ++seed) {
    AddStraight("hopper_hop", seed, 3, {0, 256, 512, 768});  // even, but unlike the others
  }
  const std::vector<Line> lines = ReadLines(databases_, {});
  const std::vector<TaskMean> means = MeansOverTasks(lines);
  ASSERT_EQ(means.size(), 1u);
  EXPECT_EQ(means[0].left_out, "");
  EXPECT_TRUE(means[0].interpolated);
  ASSERT_GT(means[0].points.size(), 4u);
  for (const LinePoint& point : means[0].points) {
    EXPECT_NEAR(point.mean, 3 * static_cast<double>(point.env_step) / 1000, 1e-9);
  }
  const Efficiency efficiency = ComputeEfficiency(databases_, {.profile_repetitions = 100});
  ASSERT_EQ(efficiency.curves.size(), 1u);
  EXPECT_EQ(efficiency.curves[0].points.size(), means[0].points.size());
}

TEST_F(CommonStepsTest, AMethodWithoutAMeanOverTasksIsNamedWithTheReason) {
  for (int seed = 0; seed < 2; ++seed) {
    for (const char* task : {"walker_walk", "cup_catch"}) {
      AddRun({.task = task, .planner = "whole", .seed = seed}, {{kSearch, 0, 1}});
      if (seed == 1 && task[0] == 'c') continue;
      AddRun({.task = task, .planner = "lacking", .seed = seed}, {{kSearch, 0, 1}});
    }
    AddRun({.task = "walker_walk", .planner = "apart", .seed = seed}, {{kSearch, 0, 1}});
    AddRun({.task = "cup_catch", .planner = "apart", .seed = seed}, {{kSearch, 10, 1}});
    AddRun({.task = "cup_catch", .planner = "half", .seed = seed}, {{kSearch, 0, 1}});
  }
  std::vector<std::string> reasons;
  for (const TaskMean& mean : MeansOverTasks(ReadLines(databases_, {}))) {
    reasons.push_back(mean.left_out);
  }
  EXPECT_EQ(
      reasons,
      (std::vector<std::string>{
          "", "lacking is left out: seed 1 has 1 of the 2 tasks.",
          "apart is left out: there is no step at which every seed has a value on every task.",
          "half is left out: it has 1 of the 2 tasks."}));
}

// The figure, its table, the page and the page's query.
TEST_F(CommonStepsTest, EveryPlaceHasTheSameNumbers) {
  if (ChartLibrary().empty()) GTEST_SKIP() << "no plotting library for the report";
  AddVaried("walker_walk");
  AddVaried("cup_catch");
  AddRun({.planner = "even"}, {{kSearch, 0, 5}, {kSearch, 500, 6}});
  AddRun({.task = "cup_catch", .planner = "even"}, {{kSearch, 0, 5}, {kSearch, 600, 6}});
  const std::vector<Line> lines = ReadLines(databases_, {});
  const nlohmann::json data = ReportData({{CurveAxis::kSteps, "steps", "steps", lines}}, {});
  const auto column = [](const Table& table, std::size_t c) {
    std::vector<double> values;
    for (const auto& row : table.rows) {
      const auto* whole = std::get_if<std::int64_t>(&row[c]);
      values.push_back(whole ? static_cast<double>(*whole) : std::get<double>(row[c]));
    }
    return values;
  };
  const auto drawn = [](const Figure& figure, std::size_t panel) {
    std::vector<std::vector<double>> ys;
    for (const Series& series : figure.panels.at(panel).series) {
      if (series.mark == Series::Mark::kLine) ys.push_back(series.y);
    }
    return ys;
  };
  const Figure by_task = CurvesByTask(lines, {}, CurveInterval::kMinMax);
  EXPECT_NE(by_task.notes.at(1).find("interpolated linearly"), std::string::npos);
  const ReportQueries queries({}, lines);
  const Table asked = RunQuery(databases_[0].get(), queries.Curves());
  std::size_t at = 0;
  for (std::size_t chart = 0; chart < 2; ++chart) {
    ASSERT_EQ(data["charts"][chart]["curves"].size(), 2u);
    for (std::size_t i : {1, 0}) {  // the query is by name: "even" before "mcts_pw"
      const auto& curve = data["charts"][chart]["curves"][i];
      const auto means = curve["mean"].get<std::vector<double>>();
      ASSERT_EQ(means.size(), i == 0 ? 8u : 2u);
      // The first planner is drawn last.
      EXPECT_EQ(drawn(by_task, chart).at(1 - i), means);
      for (std::size_t k = 0; k < means.size(); ++k, ++at) {
        const auto& row = asked.rows.at(at);
        EXPECT_EQ(std::get<std::int64_t>(row[2]), curve["env_step"][k].get<std::int64_t>());
        EXPECT_NEAR(std::get<double>(row[3]), means[k], 1e-9);
        EXPECT_NEAR(std::get<double>(row[4]), curve["lo"][k].get<double>(), 1e-9);
        EXPECT_NEAR(std::get<double>(row[5]), curve["hi"][k].get<double>(), 1e-9);
        EXPECT_EQ(std::get<std::int64_t>(row[6]), curve["n"].get<std::int64_t>());
      }
    }
  }
  EXPECT_EQ(at, asked.rows.size());

  // Over tasks the even line too is interpolated, because its tasks differ.
  const Table over_tasks = OverTasksTable(lines);
  const Table asked_over_tasks = RunQuery(databases_[0].get(), queries.OverTasks());
  std::vector<double> page;
  for (const auto& curve : data["charts"][2]["curves"]) {
    for (const double mean : curve["mean"]) page.push_back(mean);
  }
  EXPECT_EQ(page, column(over_tasks, 3));
  ASSERT_EQ(asked_over_tasks.rows.size(), over_tasks.rows.size());
  std::vector<double> sorted = page, other = column(asked_over_tasks, 2);
  std::sort(sorted.begin(), sorted.end());
  std::sort(other.begin(), other.end());
  for (std::size_t i = 0; i < sorted.size(); ++i) EXPECT_NEAR(sorted[i], other[i], 1e-9);
}

TEST_F(CommonStepsTest, AThinnedGridHasValuesOfTheWholeOne) {
  for (int seed = 0; seed < 2; ++seed) {
    std::vector<std::int64_t> steps;
    for (int i = 0; i < 100; ++i) steps.push_back(100 * i + 13 * (i % 5) * seed);
    AddStraight("walker_walk", seed, seed + 0.3, steps);
  }
  std::vector<Line> lines = ReadLines(databases_, {});
  std::map<std::int64_t, double> whole;
  for (const LinePoint& point : Points(lines[0])) whole[point.env_step] = point.mean;
  EXPECT_EQ(Thin(40, &lines), 3u);
  const std::vector<LinePoint> thinned = Points(lines[0]);
  EXPECT_LT(thinned.size(), 45u);
  for (const LinePoint& point : thinned) EXPECT_EQ(whole.at(point.env_step), point.mean);
  // Its query gives the whole grid.
  const ReportQueries queries({}, lines);
  EXPECT_EQ(RunQuery(databases_[0].get(), queries.Curves()).rows.size(), whole.size() - 1);
}

// A hole in one seed must not shift its points against those of the others.
TEST_F(CommonStepsTest, ThinningKeepsSeedsInStep) {
  std::vector<Value> values;
  for (int i = 0; i < 100; ++i) values.push_back({kSearch, 100 * i, 1.0 * i});
  AddRun({.seed = 0}, values);
  values[50].episode_return = std::nan("");
  AddRun({.seed = 1}, values);
  std::vector<Line> lines = ReadLines(databases_, {});
  EXPECT_EQ(Thin(40, &lines), 3u);
  const LineCurve curve = CurveOf(lines[0]);
  EXPECT_FALSE(curve.interpolated);
  EXPECT_EQ(curve.points.size(), 33u);  // 34 but for the hole's
  for (const LinePoint& point : curve.points) EXPECT_EQ(point.lo, point.hi);
}

}  // namespace
}  // namespace dreamsearch::results
