// What is read from several databases together is what it would be if they had been merged; and
// what is missing is the same wherever it is asked.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "results/analysis/comparison.h"
#include "results/analysis/missing_runs.h"
#include "results/analysis/published.h"
#include "results/analysis/time_use.h"
#include "results/database/query.h"
#include "results/figures/curve_figure.h"
#include "results/report/page/embedded.h"
#include "results/report/report.h"
#include "results/system/error.h"
#include "results/upkeep/merge.h"
#include "tests/results/analysis/curves_fixture.h"

namespace dreamsearch::results {
namespace {

// databases_[0] of the fixture is one machine's; Other() is another's.
class SeveralDatabases : public CurvesTest {
 protected:
  void AddTo(std::size_t database, const RunSettings& settings, const std::vector<Value>& values,
             RunStatus status = RunStatus::kFinished) {
    std::swap(databases_[0], databases_[database]);
    AddRun(settings, values, status);
    std::swap(databases_[0], databases_[database]);
  }
  void SetUp() override { databases_.push_back(Database::OpenOrCreate(folder_ / "other.db")); }

  MergeResult MergeBoth(std::vector<std::unique_ptr<Database>>* merged) {
    merged->push_back(Database::OpenOrCreate(folder_ / "merged.db"));
    Merge(merged->front().get(), databases_[0]->path());
    return Merge(merged->front().get(), databases_[1]->path());
  }
};

TEST_F(SeveralDatabases, ARunRecordedOnTwoMachinesCountsOnceWithTheNoteOfMerge) {
  for (int seed = 0; seed < 3; ++seed) {
    const double value = 100.0 * seed;
    AddTo(0, {.seed = seed}, {{kTrain, 95000, 0}, {kSearch, 0, 1}, {kSearch, 95000, value}});
    // The other machine's records differ, so that it shows which of them was taken.
    const bool cut = seed == 0;
    AddTo(1, {.seed = seed}, {{kTrain, 95000, 0}, {kSearch, 0, 2}, {kSearch, 95000, value + 7}},
          cut ? RunStatus::kInterrupted : RunStatus::kFinished);
  }
  std::vector<std::unique_ptr<Database>> merged;
  const std::vector<std::string> notes = MergeBoth(&merged).notes;
  ASSERT_EQ(notes.size(), 3u);

  const Comparison apart = Compare(databases_, {.repetitions = 100, .profile_repetitions = 10});
  const Comparison together = Compare(merged, {.repetitions = 100, .profile_repetitions = 10});
  EXPECT_EQ(RunsText(apart.contenders[0]), "n = 3");
  EXPECT_EQ(apart.contenders[0].scores, together.contenders[0].scores);
  for (const std::string& note : notes) {
    EXPECT_NE(std::find(apart.notes.begin(), apart.notes.end(), note), apart.notes.end()) << note;
  }

  const std::vector<Line> lines = ReadLines(databases_, {});
  EXPECT_EQ(CurveTable(lines).rows, CurveTable(ReadLines(merged, {})).rows);
  EXPECT_EQ(TimeTable(ReadTimeUse(databases_, {})).rows, TimeTable(ReadTimeUse(merged, {})).rows);
  EXPECT_EQ(NotesOfRuns(lines), notes);
  const Figure figure = CurvesByTask(lines, {}, CurveInterval::kMinMax);
  EXPECT_EQ(std::count(figure.notes.begin(), figure.notes.end(), notes[0]), 1);
  if (ChartLibrary().empty()) GTEST_SKIP() << "no plotting library for the report";
  EXPECT_NE(ReportPage(databases_, {}).find(notes[0]), std::string::npos);
}

// A copy of a database, one of which went on.
TEST_F(SeveralDatabases, OfOneRunInTwoDatabasesTheRecordThatGotFurtherCounts) {
  const std::vector<Value> values = {{kSearch, 0, 1}, {kSearch, 10, 2}};
  AddTo(0, {.seed = 0}, {values[0]}, RunStatus::kInterrupted);
  AddTo(1, {.seed = 0}, values);
  databases_[1]->connection().Execute("UPDATE run SET uuid = '" +
                                      databases_[0]->ListRuns()[0].uuid + "'");
  for (int order = 0; order < 2; ++order) {
    const Line line = ReadLines(databases_, {})[0];
    ASSERT_EQ(line.runs.size(), 1u);
    EXPECT_EQ(line.runs[0].value, (std::vector<double>{1, 2}));
    EXPECT_TRUE(NotesOfRuns({line}).empty());
    std::swap(databases_[0], databases_[1]);
  }
}

TEST_F(SeveralDatabases, APublishedCurveInBothIsDrawnOnce) {
  AddTo(0, {}, {{kSearch, 0, 1}});
  AddTo(1, {.seed = 1}, {{kSearch, 0, 1}});
  PublishedPoint point = {.source = "s",
                          .method = "m",
                          .obs = "state",
                          .task = "walker_walk",
                          .env_steps = 10,
                          .seed = 0,
                          .episode_return = 5};
  StorePublished(databases_[0].get(), {point});
  point.seed = 1;
  StorePublished(databases_[1].get(), {point});
  point.seed = 0;
  point.episode_return = 4;
  StorePublished(databases_[1].get(), {point});
  std::vector<std::unique_ptr<Database>> merged;
  MergeBoth(&merged);
  const std::vector<Line> lines = ReadLines(databases_, {.published = {"all"}});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[1].n(), 2);
  EXPECT_EQ(CurveTable(lines).rows, CurveTable(ReadLines(merged, {.published = {"all"}})).rows);
}

TEST_F(SeveralDatabases, ATaskWithOtherValuesIsNotAveraged) {
  AddTo(0, {}, {{kSearch, 0, 1}});
  AddTo(1, {.seed = 1}, {{kSearch, 0, 1}});
  databases_[1]->connection().Execute("UPDATE task SET return_high = 10");
  try {
    ReadLines(databases_, {});
    FAIL();
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find("walker_walk"), std::string::npos);
  }
}

TEST_F(SeveralDatabases, AScoreSaysWhatItIsWithout) {
  AddTo(0, {}, {{kSearch, 95000, 10}, {kSearch, 95000, std::nan("")}, {kSearch, 96000, 20}});
  const Comparison comparison =
      Compare(databases_, {.repetitions = 100, .profile_repetitions = 10});
  EXPECT_DOUBLE_EQ(comparison.contenders[0].scores[0][0], 0.015);
  EXPECT_EQ(
      comparison.notes.at(0),
      "walker_walk, mcts_pw: the score of seed 0 is without 1 of its 3 episodes, whose return "
      "was not finite.");
}

class MissingTest : public SeveralDatabases {
 protected:
  // "task|planner|seed" of the view's, of the function's and of the notes' missing runs.
  static std::vector<std::string> OfView(Database* database) {
    std::vector<std::string> lines;
    for (const auto& row : RunQuery(database,
                                    "SELECT task || '|' || planner || '|' || seed AS line FROM"
                                    " v_matrix WHERE status = 'missing' ORDER BY line")
                               .rows) {
      lines.push_back(std::get<std::string>(row[0]));
    }
    return lines;
  }
  std::vector<std::string> OfFunction(const RunFilter& filter = {}) {
    std::vector<std::string> lines;
    for (const MissingRun& run : MissingRuns(databases_, filter)) {
      lines.push_back(run.task + "|" + run.planner + "|" + std::to_string(run.seed));
    }
    std::sort(lines.begin(), lines.end());
    return lines;
  }
};

TEST_F(MissingTest, ListViewAndCurvesAgree) {
  databases_.pop_back();
  for (int seed = 0; seed < 3; ++seed) {
    AddRun({.config = R"({"depth":3})", .seed = seed}, {{kSearch, 0, 1}});
    if (seed < 2) AddRun({.config = R"({"depth":4})", .seed = seed}, {{kSearch, 0, 1}});
    AddRun({.planner = "rollout", .seed = seed}, {{kSearch, 0, 1}});
    if (seed != 1)
      AddRun({.task = "cup_catch", .planner = "rollout", .seed = seed}, {{kSearch, 0, 1}});
  }
  AddRun({.study = "other", .seed = 9}, {{kSearch, 0, 1}});
  const std::vector<std::string> expected = {"cup_catch|mcts_pw|0", "cup_catch|mcts_pw|1",
                                             "cup_catch|mcts_pw|2", "cup_catch|rollout|1",
                                             "walker_walk|mcts_pw|2"};
  EXPECT_EQ(OfView(databases_[0].get()), expected);
  EXPECT_EQ(OfFunction(), expected);
  std::vector<std::string> notes = MissingOrUnfinished(ReadLines(databases_, {}));
  std::sort(notes.begin(), notes.end());
  EXPECT_EQ(notes, (std::vector<std::string>{
                       "cup_catch, mcts_pw (default): every seed is missing.",
                       "cup_catch, rollout (default): seed 1 is missing.",
                       "walker_walk, mcts_pw depth=4 (default): seed 2 is missing."}));
  // Chosen among what is missing, not made anew of what is chosen.
  const RunFilter filter = {.tasks = {"cup_catch"}, .planners = {"rollout"}};
  EXPECT_EQ(OfFunction(filter), (std::vector<std::string>{"cup_catch|rollout|1"}));
  EXPECT_EQ(MissingOrUnfinished(ReadLines(databases_, {.filter = filter})).size(), 1u);
  EXPECT_EQ(OfFunction({.seeds = {2}}).size(), 2u);
}

TEST_F(MissingTest, WhatAnotherDatabaseHasIsNotMissing) {
  AddTo(0, {.seed = 0}, {{kSearch, 0, 1}});
  AddTo(1, {.seed = 1}, {{kSearch, 0, 1}});
  AddTo(1, {.planner = "rollout", .seed = 0}, {{kSearch, 0, 1}});
  EXPECT_EQ(OfFunction(), (std::vector<std::string>{"walker_walk|rollout|1"}));
  EXPECT_EQ(MissingOrUnfinished(ReadLines(databases_, {})),
            (std::vector<std::string>{"walker_walk, rollout: seed 1 is missing."}));
  AddTo(1, {.seed = 2}, {{kSearch, 0, 1}});
  EXPECT_EQ(MissingOrUnfinished(ReadLines(databases_, {})),
            (std::vector<std::string>{"walker_walk, rollout: seeds 1, 2 are missing."}));
}

TEST_F(MissingTest, AStudyWithoutRunsLacksNothing) {
  databases_[0]->Study("empty");
  EXPECT_TRUE(OfFunction().empty());
  EXPECT_TRUE(ReadLines(databases_, {}).empty());
}

}  // namespace
}  // namespace dreamsearch::results
