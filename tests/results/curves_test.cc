#include "results/analysis/curves.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>

#include "recording.h"
#include "results/analysis/published.h"
#include "results/database/query.h"
#include "results/figures/curve_figure.h"
#include "results/figures/page/embedded.h"
#include "results/figures/report.h"
#include "results/system/file.h"

namespace dreamsearch::results {
namespace {

class CurvesTest : public testing::Test {
 protected:
  CurvesTest() { databases_.push_back(Database::OpenOrCreate(folder_ / "r.db")); }

  struct Value {
    Phase phase;
    std::int64_t env_step;
    double episode_return;
  };
  std::int64_t AddRun(const RunSettings& settings, const std::vector<Value>& values,
                      RunStatus status = RunStatus::kFinished) {
    Database* db = databases_[0].get();
    const std::int64_t run = MakeRun(db, settings);
    RunWriter writer(db, run);
    writer.BeginSegment(MakeSegment(db));
    std::int64_t episodes[kPhases] = {};
    for (const Value& value : values) {
      writer.AddEpisode({.phase = value.phase,
                         .episode = episodes[static_cast<int>(value.phase)]++,
                         .env_step = value.env_step,
                         .episode_return = value.episode_return,
                         .model_transitions = 10});
      writer.AddTimeUse(value.env_step, "learning", 0.01 * static_cast<double>(value.env_step));
      writer.AddTimeUse(value.env_step, "evaluation", 1e6);
      writer.SetProgress(value.env_step);
    }
    writer.Finish();
    db->SetRunStatus(run, status, 0);
    return run;
  }
  static constexpr Phase kTrain = Phase::kTraining, kSearch = Phase::kSearchEvaluation,
                         kActor = Phase::kActorEvaluation;

  TemporaryFolder folder_;
  std::vector<std::unique_ptr<Database>> databases_;
};

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
  const std::vector<Line> lines = ReadLines(databases_, {});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].label, "dreamer");  // the paper's order
  EXPECT_FALSE(lines[0].with_search);
  EXPECT_EQ(Points(lines[0])[0].mean, 7);
  EXPECT_TRUE(lines[1].with_search);
  EXPECT_EQ(Points(lines[1])[0].mean, 1);
  EXPECT_EQ(Points(ReadLines(databases_, {.phase = CurvePhase::kActorEvaluation})[1])[0].mean, 5);
}

TEST_F(CurvesTest, OtherSettingsAreOtherLinesNamedByTheDifference) {
  AddRun({.config = R"({"mcts_pw":{"depth":3},"steps":5})"}, {{kSearch, 0, 1}});
  AddRun({.config = R"({"mcts_pw":{"depth":4},"steps":5})"}, {{kSearch, 0, 1}});
  const std::vector<Line> lines = ReadLines(databases_, {});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].label, "mcts_pw mcts_pw.depth=3");
  EXPECT_EQ(lines[1].label, "mcts_pw mcts_pw.depth=4");
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
  EXPECT_EQ(OrderedLabels(groups), (std::vector<std::string>{"rollout", "mcts_pw mcts_pw.depth=3",
                                                             "mcts_pw mcts_pw.depth=4"}));
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
  EXPECT_EQ(labels[0].substr(0, 15), "rollout config ");
  EXPECT_EQ(labels[1].substr(0, 15), "rollout config ");
  EXPECT_EQ(labels[2], "mcts_pw");
  EXPECT_EQ(labels[3], "mcts_pw b=2");
}

TEST_F(CurvesTest, EvaluationsAloneAreSaidToBeThere) {
  EXPECT_NE(NothingToGroup(databases_, {}).find("no runs of that kind"), std::string::npos);
  AddRun({.env_steps_target = 0}, {{kSearch, 0, 1}});
  EXPECT_TRUE(GroupRuns(databases_, {}, CurvePhase::kEvaluation).empty());
  EXPECT_NE(NothingToGroup(databases_, {}).find("but 1 evaluation."), std::string::npos);
}

TEST_F(CurvesTest, SecondsLeaveEvaluationOutAndAreInterpolated) {
  AddRun({}, {{kTrain, 1000, 0}, {kTrain, 2000, 0}, {kSearch, 1500, 3}});
  const Line line = ReadLines(databases_, {.axis = CurveAxis::kSeconds})[0];
  ASSERT_EQ(line.runs[0].x.size(), 1u);
  EXPECT_DOUBLE_EQ(line.runs[0].x[0], 15);
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
  EXPECT_EQ(figure.legend[0].text, "rollout with search (n = 1)");
  EXPECT_EQ(figure.legend[1].text, "mcts_pw with search (n = 2)");
  EXPECT_EQ(Gaps(lines), (std::vector<std::string>{
                             "walker_walk, rollout: seed 1 is missing.",
                             "walker_walk, mcts_pw: seed 1 crashed at 0 of 100,000 steps."}));
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
  const Figure figure = TimeByPlanner(databases_, {});
  EXPECT_EQ(figure.panels[0].categories,
            (std::vector<std::string>{"mcts_pw depth=3 (n = 1)", "mcts_pw depth=4 (n = 1)"}));
  const Table table = TimeTable(databases_, {});
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

// Texts of an SVG picture that are anchored at their left, and where they end, in
// pixels; a letter is taken to be 7.2 wide.
std::vector<std::pair<std::string, double>> LeftTexts(const std::string& svg) {
  const std::regex form(
      R"re(translate\(([0-9.]+),[^>]*text-anchor="start">\s*<text>([^<]*)</text>)re");
  std::vector<std::pair<std::string, double>> texts;
  for (std::sregex_iterator it(svg.begin(), svg.end(), form), none; it != none; ++it) {
    const std::string text = (*it)[2];
    texts.emplace_back(text, std::stod((*it)[1]) + 7.2 * static_cast<double>(text.size()));
  }
  return texts;
}

TEST(Figure, LongLegendEntriesAreWrappedAndLoseNothing) {
  Figure figure;
  figure.panels.push_back({.title = "t", .series = {{.x = {0, 1}, .y = {0, 1}}}});
  const std::string shared =
      "mcts_pw model.parameters.entropy_scale=0.003 model.parameters.slow_critic_weight=1.0 ";
  const std::string word(150, 'w');
  figure.legend = {{.text = shared + "run.train_every=2 (n = 3)", .style = 0},
                   {.text = shared + "run.train_every=3 (n = 3)", .style = 1},
                   {.text = word, .style = 2}};
  const std::string svg = DrawSvg(figure);
  double width = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("<svg"), "<svg width=\"%lf\"", &width), 1)
      << svg.substr(0, 300);
  std::string all;
  for (const auto& [text, right] : LeftTexts(svg)) {
    EXPECT_LE(right, width) << text;
    all += text + (text.find('w') == 0 ? "" : " ");
  }
  for (const LegendEntry& entry : figure.legend) {
    EXPECT_NE(all.find(entry.text), std::string::npos) << all;
  }
}

TEST(Figure, LongNamesBesideAnAxisAreWrapped) {
  Figure figure;
  figure.panels.push_back(
      {.title = "t",
       .series = {
           {.mark = Series::Mark::kInterval, .x = {0.5}, .y = {0}, .lo = {0.4}, .hi = {0.6}}}});
  std::string name = "mcts_pw";
  for (int i = 0; i < 6; ++i) name += " model.parameters.setting_" + std::to_string(i) + "=1.0";
  figure.panels[0].categories = {name};
  const std::string svg = DrawSvg(figure);
  double width = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("<svg"), "<svg width=\"%lf\"", &width), 1);
  EXPECT_LT(width, 800);
  EXPECT_NE(svg.find("setting_5=1.0"), std::string::npos);
  // Below bars a number stands for it.
  figure.panels[0].series[0].mark = Series::Mark::kBar;
  figure.panels[0].series[0].x = {0};
  const std::string bars = DrawSvg(figure);
  EXPECT_NE(bars.find("<text>1</text>"), std::string::npos);
  EXPECT_NE(bars.find("<text>1: mcts_pw model."), std::string::npos);
}

TEST(RunGroups, AShortLabelHasTheSettingsOwnNames) {
  EXPECT_EQ(ShortLabel("mcts_pw model.parameters.norm=\"a.b\" run.steps=0.5 (study.x=1)"),
            "mcts_pw norm=\"a.b\" steps=0.5 (study.x=1)");
  EXPECT_EQ(ShortLabel("a.lr=1 b.lr=2 c.d=3"), "a.lr=1 b.lr=2 d=3");
}

// U+10FFFD is of no font.
TEST(Figure, ALetterThatNoFontHasIsReplacedByTheSignForIt) {
  const TemporaryFolder folder;
  Figure figure;
  figure.panels.push_back({.title = "t", .series = {{.x = {0, 1}, .y = {0, 1}}}});
  figure.title = "a \xF4\x8F\xBF\xBD b \xFF";
  Draw(figure, folder / "a.png");
  figure.title = "a \xEF\xBF\xBD b \xEF\xBF\xBD";
  Draw(figure, folder / "b.png");
  EXPECT_EQ(ReadWholeFile(folder / "a.png"), ReadWholeFile(folder / "b.png"));
  figure.title = "first line\nsecond line";
  const std::string svg = DrawSvg(figure);
  EXPECT_NE(svg.find(">first line<"), std::string::npos);
  EXPECT_NE(svg.find(">second line<"), std::string::npos);
}

class ReportTest : public CurvesTest {
 protected:
  void SetUp() override {
    if (ChartLibrary().empty()) GTEST_SKIP() << "no plotting library for the report";
  }

  static std::string Between(const std::string& text, const std::string& begin,
                             const std::string& end, std::size_t* from) {
    const std::size_t at = text.find(begin, *from);
    if (at == std::string::npos) return "";
    *from = text.find(end, at);
    return text.substr(at + begin.size(), *from - at - begin.size());
  }
  static nlohmann::json Data(const std::string& page) {
    std::size_t from = 0;
    return nlohmann::json::parse(Between(page, "id=\"data\">", "</script>", &from));
  }
  // As a reader copies them from the page.
  static std::vector<std::string> Queries(const std::string& page) {
    std::vector<std::string> queries;
    std::size_t from = 0;
    while (true) {
      std::string sql = Between(page, "<pre><code>", "</code></pre>", &from);
      if (sql.empty()) return queries;
      for (const auto& [entity, c] : std::vector<std::pair<std::string, std::string>>{
               {"&#39;", "'"}, {"&quot;", "\""}, {"&lt;", "<"}, {"&gt;", ">"}, {"&amp;", "&"}}) {
        for (std::size_t at; (at = sql.find(entity)) != std::string::npos;) {
          sql.replace(at, entity.size(), c);
        }
      }
      queries.push_back(sql);
    }
  }
  void Publish(std::int64_t points) {
    std::vector<PublishedPoint> curve;
    for (std::int64_t i = 0; i < points; ++i) {
      curve.push_back({.source = "s",
                       .method = "m",
                       .obs = "state",
                       .task = "walker_walk",
                       .env_steps = 10 * i,
                       .seed = 0,
                       .episode_return = 1});
    }
    StorePublished(databases_[0].get(), curve);
  }
};

// A published curve of many points must not decide how ours is thinned, on one axis
// and not on another.
TEST_F(ReportTest, EveryAxisHasTheSamePoints) {
  std::vector<Value> values;
  for (int i = 0; i < 100; ++i) values.push_back({kSearch, 100 * i, 1.0 * i});
  AddRun({.seed = 0}, values);
  Publish(1000);
  const std::string page = ReportPage(databases_, {.published = {"all"}});
  const nlohmann::json line = Data(page)["lines"][0];
  const auto& steps = line["steps"];
  ASSERT_EQ(steps.size(), 34u);  // 1 + 99 / 3
  for (std::size_t i = 0; i < steps.size(); ++i) {
    ASSERT_TRUE(line["runs"][0]["s"][i].is_number()) << i;
    EXPECT_NEAR(line["runs"][0]["s"][i].get<double>(), 0.01 * steps[i].get<double>(), 0.01);
  }
  EXPECT_NE(page.find("mean of 3 neighbouring evaluations"), std::string::npos);
}

TEST_F(ReportTest, LongBudgetsAreThinnedByBins) {
  std::vector<Value> values;
  for (int i = 0; i < 50; ++i) values.push_back({kSearch, 10000 * i, 1.0 * i});
  AddRun({.env_steps_target = 490000}, values);
  EXPECT_NE(ReportPage(databases_, {}).find("mean of 2 neighbouring bins of 10,000 steps"),
            std::string::npos);
}

TEST_F(ReportTest, EachQueryGivesTheNumbersOfItsFigure) {
  const std::string study = "it's ours";
  for (const char* task : {"walker_walk", "cup_catch"}) {
    for (int seed = 0; seed < 3; ++seed) {
      const double base = 100 * seed + (task[0] == 'c' ? 50 : 0);
      for (const char* config : {R"({"depth":3})", R"({"depth":4})"}) {
        AddRun({.study = study, .task = task, .config = config, .seed = seed},
               {{kTrain, 50000, 7},
                {kActor, 0, 900},
                {kSearch, 0, base},
                {kSearch, 50000, base + 20},
                {kSearch, 95000, base + config[9]},
                // Only one seed gets here.
                {kSearch, 95000 + (seed == 0 ? 5000 : 0), base + 40}});
      }
      AddRun({.study = study, .task = task, .planner = "dreamer", .seed = seed},
             {{kActor, 0, base}, {kActor, 95000, base + 60}});
    }
  }
  // Other things in the same file: another study, machine and kind of run.
  AddRun({.study = "other", .seed = 9}, {{kSearch, 0, 1}, {kSearch, 95000, 1}});
  databases_[0]->connection().Execute(
      "INSERT INTO host SELECT 99, 'elsewhere', cpu, cores, memory_bytes, os FROM host LIMIT 1;"
      "UPDATE segment SET host_id = 99 WHERE run_id = (SELECT max(run_id) FROM run)");
  AddRun({.study = study, .seed = 0, .parent_run_id = 1}, {{kSearch, 0, 1000}});

  const ReportRequest request = {.filter = {.studies = {study}, .seeds = {0, 1, 2}}};
  const std::string page = ReportPage(databases_, request);
  EXPECT_EQ(page.find("elsewhere"), std::string::npos);
  const std::vector<std::string> queries = Queries(page);
  ASSERT_EQ(queries.size(), 5u);
  const auto answer = [&](std::size_t i) { return RunQuery(databases_[0].get(), queries[i]).rows; };
  const auto sorted = [](std::vector<std::vector<Cell>> rows) {
    std::sort(rows.begin(), rows.end());
    return rows;
  };
  const auto text = [](const Table& table) { return table.Print(TableForm::kCsv); };

  const std::vector<Line> lines = ReadLines(databases_, {.filter = request.filter});
  ASSERT_EQ(lines.size(), 6u);
  std::vector<std::vector<Cell>> points;
  for (const Line& line : lines) {
    for (const LinePoint& point : Points(line)) {
      if (point.n < line.n()) continue;
      points.push_back({line.task, line.label, point.env_step, point.mean, point.lo, point.hi,
                        std::int64_t{point.n}});
    }
  }
  EXPECT_EQ(text({std::vector<std::string>(7), answer(0)}),
            text({std::vector<std::string>(7), sorted(points)}));

  std::vector<std::vector<Cell>> over_tasks;
  for (const auto& row : OverTasksTable(lines).rows) {
    over_tasks.push_back({row[0], row[1], row[3], row[4], row[5], row[6]});
  }
  const auto found = answer(1);
  over_tasks = sorted(over_tasks);
  ASSERT_EQ(found.size(), over_tasks.size());
  ASSERT_EQ(found.size(), 8u);  // 2 of the dreamer, 3 of each depth
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i][0], over_tasks[i][0]);
    EXPECT_EQ(found[i][1], over_tasks[i][1]);
    for (std::size_t k = 2; k < 5; ++k) {
      EXPECT_NEAR(std::get<double>(found[i][k]), std::get<double>(over_tasks[i][k]), 1e-12);
    }
    EXPECT_EQ(found[i][5], over_tasks[i][5]);
  }

  std::vector<std::vector<Cell>> times;
  for (const auto& row : TimeTable(databases_, request.filter).rows) {
    times.push_back({row[0], row[2], row[3]});
  }
  EXPECT_EQ(sorted(answer(2)), sorted(times));

  const Comparison comparison = Compare(
      databases_, {.filter = request.filter, .repetitions = 100, .profile_repetitions = 100});
  std::vector<double> scores, asked;
  for (const Contender& contender : comparison.contenders) {
    for (const auto& runs : contender.scores) scores.insert(scores.end(), runs.begin(), runs.end());
  }
  for (const auto& row : answer(3)) asked.push_back(std::get<double>(row[4]));
  std::sort(scores.begin(), scores.end());
  std::sort(asked.begin(), asked.end());
  ASSERT_EQ(asked.size(), scores.size());
  for (std::size_t i = 0; i < asked.size(); ++i) EXPECT_NEAR(asked[i], scores[i], 1e-12);

  EXPECT_EQ(answer(4).size(), 18u);
}

TEST_F(ReportTest, TheQueryOfALongBudgetIsOfBins) {
  AddRun({.env_steps_target = 200000}, {{kSearch, 10000, 1}, {kSearch, 10001, 2}});
  const std::vector<std::string> queries = Queries(ReportPage(databases_, {}));
  const Table table = RunQuery(databases_[0].get(), queries.at(0));
  ASSERT_EQ(table.rows.size(), 2u);
  EXPECT_EQ(std::get<std::int64_t>(table.rows[1][2]), 20000);
  EXPECT_EQ(std::get<double>(table.rows[1][3]), 2);
}

}  // namespace
}  // namespace dreamsearch::results
