// curves_fixture.h - a database of made-up runs, for tests of what is shown of them.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/results/database/recording.h"

namespace dreamsearch::results {

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
                         .model_transitions = settings.planner == "random" ? 0 : 10});
      const double seconds = 0.01 * static_cast<double>(value.env_step);
      writer.AddTimeUse({value.env_step, "learning", seconds, 2 * seconds, 120 * seconds});
      writer.AddTimeUse({value.env_step, "evaluation", 1e6, 1e6, 1e8});
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

}  // namespace dreamsearch::results
