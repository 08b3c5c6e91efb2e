#include "host/settings/schedule.h"

#include <gtest/gtest.h>

#include "host/settings/run_parameters.h"

namespace dreamsearch {
namespace {

RunSpec SpecWith(std::initializer_list<std::pair<const char*, double>> changed) {
  RunSpec spec;
  for (const ParameterSpec& parameter : RunParameters()) {
    ResolvedValue value;
    value.name = parameter.name;
    value.type = parameter.type;
    value.number = parameter.default_number;
    for (const auto& [name, number] : changed) {
      if (value.name == name) value.number = number;
    }
    spec.run.values.push_back(value);
  }
  return spec;
}

// algorithm: 5000 random steps, 100 updates, then 1 for every 10 steps; evaluation
// at 0 and every min(10000, budget / 10).
TEST(Schedule, CountsOfTheDefaultSchedule) {
  const RunSpec spec = SpecWith({{"steps", 60000}, {"train_every", 10}});
  const Schedule schedule(spec, 1000);
  EXPECT_EQ(schedule.training_episodes(), 60u);
  EXPECT_EQ(schedule.decisions(), 30000u);
  EXPECT_EQ(schedule.planned_decisions(), 27500u);
  EXPECT_EQ(schedule.updates(), 100u + 5500u);
  EXPECT_EQ(schedule.eval_every(), 6000u);
  EXPECT_EQ(schedule.evaluations(), 11u);
  EXPECT_EQ(schedule.replay_rows(), 60u * 501);
}

TEST(Schedule, MakesSeveralUpdatesAtATime) {
  const RunSpec spec = SpecWith({{"steps", 60000}, {"train_every", 10}, {"updates", 3}});
  EXPECT_EQ(Schedule(spec, 1000).updates(), 100u + 3 * 5500u);
}

TEST(Schedule, EvaluatesEveryTenThousandStepsOfALongRun) {
  const RunSpec spec = SpecWith({{"steps", 2000000}});
  EXPECT_EQ(Schedule(spec, 1000).eval_every(), 10000u);
}

TEST(Schedule, ARepeatThatDoesNotDivideTheEpisodeRoundsUp) {
  const RunSpec spec = SpecWith({{"steps", 3000}, {"action_repeat", 3}});
  EXPECT_EQ(Schedule(spec, 1000).decisions_per_episode(), 334u);
  EXPECT_EQ(Schedule(spec, 1000).decisions(), 3u * 334);
}

}  // namespace
}  // namespace dreamsearch
