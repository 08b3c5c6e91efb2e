#include "results/report/report.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "results/analysis/comparison.h"
#include "results/analysis/line_statistics.h"
#include "results/analysis/published.h"
#include "results/analysis/time_use.h"
#include "results/database/query.h"
#include "results/report/page/embedded.h"
#include "results/text/text.h"
#include "tests/results/analysis/curves_fixture.h"

namespace dreamsearch::results {
namespace {

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
  const nlohmann::json curve = Data(page)["charts"][0]["curves"][0];
  const auto& steps = curve["env_step"];
  ASSERT_EQ(steps.size(), 34u);  // 1 + 99 / 3
  ASSERT_EQ(curve["x"]["seconds"].size(), steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    EXPECT_EQ(curve["x"]["steps"][i], steps[i]);
    EXPECT_NEAR(curve["x"]["seconds"][i].get<double>(), 0.01 * steps[i].get<double>(), 1e-9);
  }
  EXPECT_NE(page.find("mean of 3 neighbouring evaluations"), std::string::npos);
}

// In text, so that not even the last bit differs.
std::vector<std::string> Texts(const nlohmann::json& numbers) {
  std::vector<std::string> texts;
  for (const auto& number : numbers) texts.push_back(ExactText(number.get<double>()));
  return texts;
}
std::vector<std::string> Column(const Table& table, std::size_t column) {
  std::vector<std::string> texts;
  for (const auto& row : table.rows) {
    const Cell& cell = row.at(column);
    const auto* whole = std::get_if<std::int64_t>(&cell);
    texts.push_back(whole != nullptr ? std::to_string(*whole) : ExactText(std::get<double>(cell)));
  }
  return texts;
}
// The rows of one line of a chart.
Table RowsOf(const Table& table, const std::vector<std::string>& names) {
  Table rows = {table.columns, {}};
  for (const auto& row : table.rows) {
    bool same = true;
    for (std::size_t i = 0; i < names.size(); ++i) {
      same = same && std::get<std::string>(row[i]) == names[i];
    }
    if (same) rows.rows.push_back(row);
  }
  return rows;
}

// `results curves` prints these tables.
TEST_F(ReportTest, ThePageHasTheNumbersOfTheTablesBitForBit) {
  for (const char* task : {"walker_walk", "cup_catch"}) {
    for (const char* planner : {"mcts_pw", "rollout"}) {
      for (int seed = 0; seed < 5; ++seed) {
        // Thirds and sevenths have no short decimal text.
        const double base = 100.0 * seed * seed / 3 + (task[0] == 'c' ? 1.0 / 7 : 0);
        AddRun({.task = task, .planner = planner, .seed = seed}, {{kTrain, 700, 1},
                                                                  {kSearch, 0, base},
                                                                  {kSearch, 1000 / 3, base + 1},
                                                                  {kSearch, 700, base * base / 7}});
      }
    }
  }
  const nlohmann::json data = Data(ReportPage(databases_, {}));
  ASSERT_EQ(data["charts"].size(), 3u);
  for (const auto& [axis, key] :
       {std::pair(CurveAxis::kSteps, "steps"), std::pair(CurveAxis::kTransitions, "transitions"),
        std::pair(CurveAxis::kSeconds, "seconds")}) {
    const std::vector<Line> lines = ReadLines(databases_, {.axis = axis});
    const Table by_task = CurveTable(lines), over_tasks = OverTasksTable(lines);
    for (const auto& chart : data["charts"]) {
      ASSERT_EQ(chart["curves"].size(), 2u);
      for (const auto& curve : chart["curves"]) {
        const std::string label = data["lines"][curve["line"].get<std::size_t>()]["label"];
        const bool mean = chart["over_tasks"];
        const Table rows = mean ? RowsOf(over_tasks, {label})
                                : RowsOf(by_task, {chart["name"].get<std::string>(), label});
        const std::size_t at = mean ? 1 : 2;
        ASSERT_EQ(rows.rows.size(), 3u);
        EXPECT_EQ(Texts(curve["env_step"]), Column(rows, at));
        EXPECT_EQ(Texts(curve["x"][key]), Column(rows, at + 1));
        EXPECT_EQ(Texts(curve["mean"]), Column(rows, at + 2));
        EXPECT_EQ(Texts(curve["lo"]), Column(rows, at + 3));
        EXPECT_EQ(Texts(curve["hi"]), Column(rows, at + 4));
        EXPECT_EQ(curve["n"].get<int>(), std::get<std::int64_t>(rows.rows[0][at + 5]));
      }
    }
  }
  const std::vector<TimeUse> uses = ReadTimeUse(databases_, {});
  for (const auto& activity : data["time"]["activities"]) {
    for (std::size_t i = 0; i < uses.size(); ++i) {
      EXPECT_EQ(ExactText(activity["seconds"][i].get<double>()),
                ExactText(uses[i].SecondsFor1000Steps(activity["name"])));
    }
  }
}

TEST_F(ReportTest, ThePageHasTheInterquartileMeanOfSeedsAndOfTasks) {
  for (int seed = 0; seed < 5; ++seed) {
    const double value = seed == 4 ? 900 : 10.0 * seed;
    AddRun({.task = "walker_walk", .seed = seed}, {{kSearch, 0, value}});
    AddRun({.task = "cup_catch", .seed = seed}, {{kSearch, 0, 40}});
  }
  const nlohmann::json charts = Data(ReportPage(databases_, {}))["charts"];
  ASSERT_EQ(charts.size(), 3u);
  EXPECT_EQ(charts[0]["name"], "cup_catch");
  EXPECT_EQ(charts[1]["curves"][0]["iqm"][0], 20);  // of 10, 20, 30
  // 0, .01, .02, .03, .04 five times, .9: the middle six.
  EXPECT_DOUBLE_EQ(charts[2]["curves"][0]["iqm"][0].get<double>(), (0.02 + 0.03 + 4 * 0.04) / 6);
}

TEST_F(ReportTest, SeedsThatHaveGoneFurtherAreTails) {
  AddRun({.seed = 0}, {{kSearch, 0, 1}, {kSearch, 10, 2}, {kSearch, 20, 100}});
  AddRun({.seed = 1}, {{kSearch, 0, 1}, {kSearch, 10, 4}});
  const nlohmann::json curve = Data(ReportPage(databases_, {}))["charts"][0]["curves"][0];
  EXPECT_EQ(curve["mean"], nlohmann::json({1, 3}));
  ASSERT_EQ(curve["tails"].size(), 1u);
  EXPECT_EQ(curve["tails"][0]["y"], nlohmann::json({2, 100}));
  EXPECT_EQ(curve["tails"][0]["x"]["steps"], nlohmann::json({10, 20}));
  ASSERT_EQ(curve["runs"].size(), 2u);
  EXPECT_EQ(curve["runs"][0]["y"], nlohmann::json({1, 2, 100}));
  EXPECT_FALSE(curve["interval"].get<bool>());
}

// JavaScript would read them as one number.
TEST_F(ReportTest, SeedsAboveWhatJavaScriptCountsAreTheSeedsOfTheRuns) {
  const std::int64_t seed = (std::int64_t{1} << 53) + 1;
  AddRun({.seed = seed - 1}, {{kSearch, 0, 1}});
  AddRun({.seed = seed}, {{kSearch, 0, 2}});
  const nlohmann::json data = Data(ReportPage(databases_, {}));
  EXPECT_EQ(data["seeds"], nlohmann::json({"9007199254740992", "9007199254740993"}));
  EXPECT_EQ(data["charts"][0]["curves"][0]["runs"][1]["seed"], "9007199254740993");
}

// What folds a list into one number, or numbers into a greater one, would be a statistic.
TEST_F(ReportTest, ThePagesScriptComputesNoStatistics) {
  const std::string script(ReportScript());
  ASSERT_NE(script.find("JSON.parse"), std::string::npos);
  for (const char* folding :
       {"reduce", "+=", "++", "for (let", "while", "Math.min(...", "Math.max(...", "a - b"}) {
    EXPECT_EQ(script.find(folding), std::string::npos) << folding;
  }
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
  for (const auto& row : TimeTable(ReadTimeUse(databases_, request.filter)).rows) {
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

TEST_F(ReportTest, AQueryNamesALineAsThePageDoesThoughEachPlannerHasOnlyOne) {
  for (const char* sha256 : {"11", "22"}) {
    AddRun({.seed = sha256[0] - '1', .planner_version = "1.0.0", .planner_sha256 = sha256},
           {{kSearch, 0, 1}});
  }
  const std::vector<std::string> queries = Queries(ReportPage(databases_, {}));
  const Table answer = RunQuery(databases_[0].get(), queries.at(0));
  ASSERT_EQ(answer.rows.size(), 1u);
  EXPECT_EQ(answer.rows[0][1], Cell(std::string("mcts_pw (2 builds)")));
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
