// Searches as teachers: what a run keeps of them, makes anew and learns from, with both models.
#include <gtest/gtest.h>
#include <signal.h>

#include <string>
#include <vector>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

constexpr char kResultDigests[] =
    "SELECT group_concat(result_digest) FROM (SELECT result_digest FROM run WHERE status = "
    "'finished' ORDER BY planner)";

class SearchTargets : public testing::TestWithParam<const char*> {
 protected:
  static std::string model() { return GetParam(); }

  // A run of some seconds with both kinds of search, of sizes that make it fast.
  static std::vector<std::string> Run(const std::string& db, const std::vector<std::string>& set) {
    std::vector<std::string> arguments = {
        "--env", "cartpole_balance", "--model", model(), "--planner", "mcts_pw,mppi", "--db",
        db,      "--steps",          "4000"};
    std::vector<std::string> settings = {
        "run.prefill_steps=1000",  "run.pretrain_updates=4", "run.train_every=20",
        "run.batch_size=8",        "run.sequence_length=6",  "run.eval_episodes=1",
        "run.eval_every=4000",     "mppi.candidates=12",     "mppi.elites=6",
        "mppi.actor_candidates=4", "mppi.iterations=2",      "mcts_pw.simulations=8"};
    const std::vector<std::string> small =
        model() == "tdmpc" ? std::vector<std::string>{"model.width=16", "model.encoder_width=16",
                                                      "model.simplices=2"}
                           : std::vector<std::string>{
                                 "model.hidden=16", "model.deterministic=16", "model.stochastic=4",
                                 "model.imagination_starts=8", "model.horizon=3"};
    settings.insert(settings.end(), small.begin(), small.end());
    for (const std::string& setting : set) {  // each parameter once
      const std::string name = setting.substr(0, setting.find('=') + 1);
      std::erase_if(settings, [&](const std::string& other) { return other.starts_with(name); });
      settings.push_back(setting);
    }
    for (const std::string& setting : settings) {
      arguments.insert(arguments.end(), {"--set", setting});
    }
    return arguments;
  }
  static std::vector<std::string> With(std::vector<std::string> arguments,
                                       const std::vector<std::string>& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  std::string Digests(const std::vector<std::string>& arguments, const std::string& db) const {
    const ProgramResult result = place_.Runner(arguments);
    EXPECT_EQ(result.exit_status, 0) << result.err;
    return place_.Value(db, kResultDigests);
  }

  Workplace place_;
};

TEST_P(SearchTargets, KeptAndMadeAnewButNotLearntFromChangeNothing) {
  const std::string off = Digests(Run("off.db", {}), "off.db");
  const std::string on =
      Digests(Run("on.db", {"run.search_targets=true", "run.reanalyse=0.1",
                            "model.search_policy_weight=0", "model.search_value_weight=0"}),
              "on.db");
  EXPECT_EQ(on, off);
  EXPECT_NE(Digests(Run("learnt.db", {"run.search_targets=true"}), "learnt.db"), off);
}

// The least share of an update's states that were searched, in the mean between two records.
double LeastSearched(const Workplace& place, const std::string& db) {
  return std::stod(place.Value(db,
                               "SELECT min(s.value) FROM scalar s JOIN metric m USING (metric_id) "
                               "WHERE m.name LIKE '%.searched'"));
}

TEST_P(SearchTargets, OfTheRandomPhaseAreMadeAnewToo) {
  Digests(Run("kept.db", {"run.search_targets=true"}), "kept.db");
  EXPECT_EQ(LeastSearched(place_, "kept.db"), 0);
  Digests(Run("renewed.db", {"run.search_targets=true", "run.reanalyse=1", "run.train_every=200"}),
          "renewed.db");
  EXPECT_NEAR(LeastSearched(place_, "renewed.db"), 1, 1e-9);
}

TEST_P(SearchTargets, MadeAnewTeachOtherThings) {
  const std::string kept = Digests(Run("kept.db", {"run.search_targets=true"}), "kept.db");
  const std::string renewed =
      Digests(Run("renewed.db", {"run.search_targets=true", "run.reanalyse=0.1"}), "renewed.db");
  EXPECT_NE(kept, renewed);
}

TEST_P(SearchTargets, JobsThreadsAndInterruptionsChangeNoDigest) {
  const std::vector<std::string> on = {"run.search_targets=true", "run.reanalyse=0.05"};
  const std::string whole = Digests(With(Run("whole.db", on), {"--jobs", "2"}), "whole.db");
  EXPECT_EQ(Digests(With(Run("one.db", on), {"--jobs", "1"}), "one.db"), whole);
  const pid_t pid = place_.Start(With(Run("parts.db", on), {"--jobs", "1"}));
  place_.WaitForStep("parts.db", 1101, 20);
  ::kill(pid, SIGINT);
  EXPECT_EQ(place_.Wait(pid).exit_status, 75);
  EXPECT_EQ(Digests({"resume", "--db", "parts.db"}, "parts.db"), whole);
}

// An actor that begins narrow comes to play as mppi's elites do. (mcts_pw's candidates are samples
// of the actor itself, so its targets move along; that such a run learns from all of them is all
// that can be said of it.)
TEST_P(SearchTargets, TheLossOfImitationFalls) {
  std::vector<std::string> set = {"run.search_targets=true", "run.reanalyse=1",
                                  "run.train_every=40", "model.search_policy_weight=10",
                                  "model.actor_learning_rate=0.003"};
  if (model() == "dreamer") set.push_back("model.actor_initial_std=0.05");
  const ProgramResult result = place_.Runner(Run("taught.db", set));
  ASSERT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(place_.Value("taught.db", "SELECT count(*) FROM run WHERE status = 'finished'"), "2");
  const std::vector<std::string> losses = place_.Query(
      "taught.db",
      "SELECT s.value FROM scalar s JOIN metric m USING (metric_id) JOIN run r USING (run_id) "
      "WHERE m.name LIKE '%.imitation_loss' AND r.planner = 'mppi' ORDER BY s.env_step");
  ASSERT_EQ(losses.size(), 4u);  // of an episode each
  EXPECT_LT(std::stod(losses.back()), 0.5 * std::stod(losses.front()));
  EXPECT_NEAR(LeastSearched(place_, "taught.db"), 1, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Models, SearchTargets, testing::Values("dreamer", "tdmpc"),
                         [](const auto& row) { return std::string(row.param); });

}  // namespace
}  // namespace dreamsearch
