// A run's threads come and go with the runs beside it; its digest stays.
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "host/settings/cores.h"
#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

using Numbers = std::vector<std::uint32_t>;

// While it lives, what is started here has one core.
class OneCore {
 public:
  OneCore() {
    ::sched_getaffinity(0, sizeof before_, &before_);
    int first = 0;
    while (!CPU_ISSET(first, &before_)) ++first;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    ::sched_setaffinity(0, sizeof one, &one);
  }
  ~OneCore() { ::sched_setaffinity(0, sizeof before_, &before_); }
  OneCore(const OneCore&) = delete;
  OneCore& operator=(const OneCore&) = delete;

 private:
  cpu_set_t before_;
};

// The numbers of threads that a run has had after its first one, by its log.
Numbers ThreadsOf(const Workplace& place, const std::string& db, const std::string& seed) {
  const std::string uuid = place.Value(db, "select uuid from run where seed = " + seed);
  std::ifstream log(place.folder() / (db + ".files") / uuid / "run.log");
  Numbers threads;
  for (std::string word; log >> word;) {
    std::uint32_t number = 0;
    if (word == "threads:" && log >> number) threads.push_back(number);
  }
  return threads;
}

bool WaitUntil(const std::function<bool()>& holds) {
  for (int i = 0; i < 6000; ++i) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

// Learns in many small bursts, so that it looks often how many threads it has.
std::vector<std::string> Learner(const std::string& db, const std::string& steps,
                                 const std::vector<std::string>& more) {
  std::vector<std::string> arguments = TinyRun("walker_walk", "dreamer", db, more);
  const auto set = [&](const std::string& tiny, const std::string& value) {
    const auto found = std::find(arguments.begin(), arguments.end(), tiny);
    ASSERT_NE(found, arguments.end()) << tiny;
    *found = value;
  };
  set("4000", steps);
  set("run.train_every=250", "run.train_every=20");
  return arguments;
}

TEST(Threads, ARunBesideWhichAnotherBeginsAndEndsHasTheDigestOfOneThread) {
  const std::uint32_t cores = AvailableCores().count;
  if (cores < 2) GTEST_SKIP() << "one core is not shared";
  const Workplace place;
  const std::string digest = "select result_digest from run where seed = 0";
  {
    const OneCore one;
    const ProgramResult result = place.Runner(Learner("one.db", "30000", {}));
    ASSERT_EQ(result.exit_status, 0) << result.err;
  }
  EXPECT_EQ(ThreadsOf(place, "one.db", "0"), Numbers());

  const pid_t run = place.Start(Learner("shared.db", "30000", {}));
  EXPECT_TRUE(WaitUntil([&] { return !ThreadsOf(place, "shared.db", "0").empty(); }));
  const ProgramResult beside = place.Runner(Learner("beside.db", "8000", {"--seed-list", "1"}));
  EXPECT_EQ(beside.exit_status, 0) << beside.err;
  const ProgramResult result = place.Wait(run);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(ThreadsOf(place, "shared.db", "0"), (Numbers{cores, cores - cores / 2, cores}));
  EXPECT_EQ(place.Value("shared.db", digest), place.Value("one.db", digest));
  EXPECT_EQ(place.Value("shared.db", digest).size(), 64u);
}

// The episodes are played in groups, each with a model of its own.
TEST(Threads, AnEvaluationOnSeveralHasTheEpisodesOfOne) {
  if (AvailableCores().count < 2) GTEST_SKIP() << "one core is not shared";
  const std::string episodes =
      "select group_concat(phase || ' ' || episode || ' ' || \"return\" || ' ' || digest, ', ') "
      "from "
      "(select * from episode order by phase, episode)";
  for (const std::string model : {"dreamer", "tdmpc", "oracle"}) {
    const Workplace place;
    const auto run = [&](const std::string& db) {
      std::vector<std::string> arguments =
          TinyRun("pendulum_swingup", "mcts_pw", db, {"--model", model});
      std::replace(arguments.begin(), arguments.end(), std::string("run.eval_episodes=1"),
                   std::string("run.eval_episodes=5"));
      for (auto at = arguments.begin(); model != "dreamer" && at != arguments.end();) {
        at = at->starts_with("model.") ? arguments.erase(at - 1, at + 1) : at + 1;
      }
      const ProgramResult result = place.Runner(arguments);
      EXPECT_EQ(result.exit_status, 0) << result.err;
      return place.Value(db, episodes);
    };
    const auto alone = [&] {
      const OneCore one;
      return run("one.db");
    }();
    EXPECT_EQ(std::count(alone.begin(), alone.end(), ','), 3 * (5 + 5) + 3) << alone;
    EXPECT_EQ(run("several.db"), alone) << model;
  }
}

TEST(Threads, TheLastRunOfASweepTakesTheCoresThatTheOthersLeave) {
  const std::uint32_t cores = AvailableCores().count;
  if (cores < 2) GTEST_SKIP() << "one core is not shared";
  const Workplace place;
  const std::string digests =
      "select group_concat(result_digest) from (select result_digest from run order by seed)";
  {
    const OneCore one;
    const ProgramResult result = place.Runner(Learner("one.db", "4000", {"--seeds", "3"}));
    ASSERT_EQ(result.exit_status, 0) << result.err;
  }
  const ProgramResult result =
      place.Runner(Learner("all.db", "4000", {"--seeds", "3", "--jobs", "2"}));
  EXPECT_EQ(result.exit_status, 0) << result.err;
  const Numbers last =
      ThreadsOf(place, "all.db",
                place.Value("all.db", "select seed from run order by ended_utc desc, seed desc"));
  ASSERT_FALSE(last.empty());
  EXPECT_EQ(last.back(), cores);
  EXPECT_EQ(place.Value("all.db", digests), place.Value("one.db", digests));
  EXPECT_EQ(place.Value("all.db", digests).size(), 3 * 64 + 2u);
}

}  // namespace
}  // namespace dreamsearch
