// Returns of whole episodes. A program of its own, as it takes the longest.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "plugins/mujoco/numpy_random.h"
#include "tests/plugins/env_dmc/kolmogorov_smirnov.h"
#include "tests/plugins/env_dmc/reference_data.h"

namespace dreamsearch::dmc {
namespace {

constexpr double kLeastP = 0.001;
// Of the ten recorded seeds, unless the whole collection is to be checked.
constexpr std::uint32_t kSeeds = 4;

// The recorder's action streams: uniform within the bounds, entry by entry, from
// a second generator of seed + 12345; or zeros.
double EpisodeReturn(const std::string& name, std::uint32_t seed, bool random_policy) {
  const TaskPtr task = MakeTask(name);
  const EnvironmentSpec& spec = task->spec();
  std::vector<double> observation(spec.observation_size);
  std::vector<double> action(spec.action_size);
  const View<double> view{observation.data(), observation.size()};
  NumpyRandom random(seed + 12345);
  if (!task->Reset(seed, view).ok()) return std::nan("");
  double sum = 0;
  StepResult result;
  while (!result.last) {
    if (random_policy) {
      for (std::size_t i = 0; i < action.size(); ++i) {
        action[i] = random.Uniform(spec.action_low[i], spec.action_high[i]);
      }
    }
    const View<const double> action_view{action.data(), action.size()};
    if (!task->Step(action_view, view, &result).ok()) return std::nan("");
    sum += result.reward;
  }
  return sum;
}

// How much a small difference grows over an episode, by the recorded growth over
// its first quarter.
double Growth(const Json& sensitivity, const std::string& name) {
  double growth = 1;
  for (const Json& row : sensitivity.at(name)) {
    growth =
        std::max(growth, row.at("step_250").get<double>() / sensitivity.at("nudge").get<double>());
  }
  return std::pow(growth, 4);
}

TEST(Returns, EqualTheRecordedOnesOrTheirDistribution) {
  const Json returns = ReadJson(ReferenceFile("returns.json"));
  const Json sensitivity = ReadJson(ReferenceFile("sensitivity.json"));

  const bool all_seeds = ReferenceFolders().size() > 1;

  struct Episode {
    std::string task;
    bool random_policy;
    std::uint32_t seed;
    double found;
  };
  struct Group {  // the episodes of one task and policy
    std::string task;
    bool random_policy;
    std::vector<double> recorded;  // all ten, in the order of seeds
    std::vector<double> found;     // the first of them
  };
  std::vector<Episode> episodes;
  std::vector<Group> groups;
  for (const auto& [name, policies] : returns.items()) {
    if (!policies.is_object() || !HasTask(name)) continue;
    for (const bool random_policy : {true, false}) {
      Group group = {name, random_policy, {}, {}};
      for (const Json& row : policies.at(random_policy ? "random" : "zero")) {
        ASSERT_EQ(row.at("seed"), group.recorded.size());
        group.recorded.push_back(row.at("total"));
        if (all_seeds || row.at("seed") < kSeeds) {
          episodes.push_back({name, random_policy, row.at("seed"), 0});
        }
      }
      groups.push_back(group);
    }
  }
  EXPECT_EQ(groups.size(), std::size(kTasks) * 2);

  // Instances share nothing, so threads may run them side by side.
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < episodes.size(); i = next++) {
      episodes[i].found =
          EpisodeReturn(episodes[i].task, episodes[i].seed, episodes[i].random_policy);
    }
  };
  std::thread other(work);
  work();
  other.join();

  std::size_t episode = 0;
  for (Group& group : groups) {
    SCOPED_TRACE(group.task + (group.random_policy ? ", random policy" : ", zero policy"));
    double largest = 0;
    for (; episode < episodes.size() && episodes[episode].task == group.task &&
           episodes[episode].random_policy == group.random_policy;
         ++episode) {
      const double recorded = group.recorded[group.found.size()];
      group.found.push_back(episodes[episode].found);
      EXPECT_TRUE(std::isfinite(group.found.back()));
      largest = std::max(largest, std::abs(recorded - group.found.back()));
    }
    Show("returns " + group.task + (group.random_policy ? " random" : " zero"), largest);
    // Rounding errors of 1e-15 may differ on another kind of processor. Where they
    // stay below 1e-6 over the episode, every reward must agree as well.
    if (1e-15 * Growth(sensitivity, group.task) <= 1e-6) {
      EXPECT_LE(largest, 1e-6 * 1000);
    } else {
      const double distance = KolmogorovSmirnovDistance(group.recorded, group.found);
      EXPECT_GT(KolmogorovSmirnovP(distance, static_cast<double>(group.recorded.size()),
                                   static_cast<double>(group.found.size())),
                kLeastP);
    }
  }
}

}  // namespace
}  // namespace dreamsearch::dmc
