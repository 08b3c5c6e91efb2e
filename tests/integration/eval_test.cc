// runner eval: a trained agent under other planners and on true dynamics.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "results/upkeep/merge.h"
#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

class EvalTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    std::vector<std::string> training = TinyRun("cartpole_swingup", "mcts_pw", "e.db");
    std::replace(training.begin(), training.end(), std::string("run.eval_episodes=1"),
                 std::string("run.eval_episodes=2"));
    const ProgramResult trained = place_->Runner(training);
    ASSERT_EQ(trained.exit_status, 0) << trained.err;
    result_ = place_->Runner({"eval", "1", "--planner", "mcts_pw,dreamer,random", "--model",
                              "dreamer,oracle", "--db", "e.db"});
  }
  static void TearDownTestSuite() { delete place_; }

  static std::string Value(const std::string& sql) { return place_->Value("e.db", sql); }
  // The episodes' digests of an evaluation of run 1.
  static std::string Digests(const std::string& planner, const std::string& model) {
    return Value(
        "select group_concat(digest) from (select digest from episode join run using "
        "(run_id) where parent_run_id = 1 and planner = '" +
        planner + "' and model = '" + model + "' order by episode)");
  }

  static Workplace* place_;
  static ProgramResult result_;
};
Workplace* EvalTest::place_ = nullptr;
ProgramResult EvalTest::result_;

TEST_F(EvalTest, TheOwnPlannerPlaysTheLastEvaluationAgain) {
  ASSERT_EQ(result_.exit_status, 0) << result_.err;
  const std::string last =
      "select group_concat(digest) from (select digest from episode where run_id = 1 and "
      "env_step = 4000 and phase = ";
  EXPECT_EQ(Digests("mcts_pw", "dreamer"), Value(last + "1 order by episode)"));
  EXPECT_EQ(Digests("dreamer", "dreamer"), Value(last + "2 order by episode)"));
}

TEST_F(EvalTest, TrueDynamicsChangeASearchAndNotTheActor) {
  // The actor alone imagines nothing, so its actions and values are those of the
  // learned model; a search imagines other futures.
  EXPECT_EQ(Digests("dreamer", "oracle"), Digests("dreamer", "dreamer"));
  EXPECT_NE(Digests("mcts_pw", "oracle"), Digests("mcts_pw", "dreamer"));
  EXPECT_EQ(Digests("random", "oracle"), Digests("random", "dreamer"));
}

TEST_F(EvalTest, IsARunThatNamesItsParentAndStaysOutOfCurves) {
  EXPECT_EQ(Value("select count(*) from run where parent_run_id = 1 and status = 'finished' and "
                  "length(result_digest) = 64 and seed = 0"),
            "6");
  EXPECT_EQ(Value("select count(distinct planner) from v_curve"), "1");
  EXPECT_EQ(Value("select count(*) from episode join run using (run_id) where parent_run_id = 1 "
                  "and env_step = 4000 and phase = iif(planner = 'dreamer', 2, 1)"),
            "12");
  EXPECT_NE(Value("select count(*) from scalar join metric using (metric_id) join run using "
                  "(run_id) where parent_run_id = 1 and name = 'mcts_pw.root_visit_entropy'"),
            "0");
}

TEST_F(EvalTest, TheTableHasAMeanAndItsErrorForEveryPlannerAndModel) {
  const std::string mean = Value(
      "select printf('%.1f', avg(episode_return)) from episode join run using (run_id) where "
      "parent_run_id = 1 and planner = 'mcts_pw' and model = 'oracle'");
  // Of two returns a and b the error of the mean is |a - b| / 2.
  const std::string error = Value(
      "select printf('%.1f', (max(episode_return) - min(episode_return)) / 2) from episode join "
      "run using (run_id) where parent_run_id = 1 and planner = 'mcts_pw' and model = 'oracle'");
  const auto begin = result_.out.find("mcts_pw  oracle");
  ASSERT_NE(begin, std::string::npos) << result_.out;
  const std::string line = result_.out.substr(begin, result_.out.find('\n', begin) - begin);
  EXPECT_NE(line.find("  " + mean + "  "), std::string::npos) << line << ", " << mean;
  EXPECT_NE(line.find("  " + error + "  "), std::string::npos) << line << ", " << error;
  EXPECT_NE(line.find("  6.0"), std::string::npos) << line;  // 6 simulations, 6 transitions
}

TEST_F(EvalTest, TheSameCommandAgainPlaysNothing) {
  const std::string before = Value("select group_concat(ended_utc) from run");
  const ProgramResult again = place_->Runner({"eval", "1", "--planner", "mcts_pw,dreamer,random",
                                              "--model", "dreamer,oracle", "--db", "e.db"});
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_NE(again.err.find("0 to play, 6 finished"), std::string::npos) << again.err;
  EXPECT_EQ(again.out, result_.out);
  EXPECT_EQ(Value("select group_concat(ended_utc) from run"), before);
}

TEST_F(EvalTest, WorksOnAMergedDatabase) {
  ASSERT_EQ(place_
                ->Runner({"eval", "--env", "pendulum_swingup", "--planner", "dreamer", "--episodes",
                          "1", "--db", "other.db"})
                .exit_status,
            0);
  {
    const auto all = results::Database::OpenOrCreate(place_->Path("far/all.db"));
    results::Merge(all.get(), place_->Path("other.db"));
    results::Merge(all.get(), place_->Path("e.db"));
  }
  const std::string trained = place_->Value(
      "far/all.db", "select run_id from run where parent_run_id is null and planner = 'mcts_pw'");
  EXPECT_NE(trained, "1");
  const ProgramResult played = place_->Runner(
      {"eval", trained, "--planner", "rollout", "--episodes", "1", "--db", "far/all.db"});
  EXPECT_EQ(played.exit_status, 0) << played.err;
  const std::vector<std::string> save = {"export", trained, "--db", "far/all.db", "--out", "far/w"};
  EXPECT_EQ(place_->Runner(save).exit_status, 0);
  const ProgramResult repeated = place_->Runner(
      {"verify",
       place_->Value("far/all.db", "select run_id from run where planner = 'random' limit 1"),
       "--db", "far/all.db"});
  EXPECT_EQ(repeated.exit_status, 0) << repeated.err;

  const std::filesystem::path files = place_->Path("e.db.files"), away = place_->Path("away");
  std::filesystem::rename(files, away);
  const ProgramResult gone = place_->Runner(save);
  std::filesystem::rename(away, files);
  EXPECT_EQ(gone.exit_status, 66) << gone.err;
  EXPECT_NE(gone.err.find(files.string()), std::string::npos) << gone.err;
}

TEST_F(EvalTest, NeedsNoTrainingOnTheOracle) {
  const std::vector<std::string> arguments = {
      "eval",       "--env", "cartpole_swingup,pendulum_swingup", "--planner", "random,dreamer",
      "--episodes", "3"};
  const auto with = [&](const std::string& db, const std::string& jobs) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), {"--db", db, "--jobs", jobs});
    return place_->Runner(all);
  };
  const ProgramResult one = with("one.db", "1");
  ASSERT_EQ(one.exit_status, 0) << one.err;
  const ProgramResult many = with("many.db", "8");
  ASSERT_EQ(many.exit_status, 0) << many.err;
  const char* digests =
      "select group_concat(result_digest) from (select result_digest from run join task using "
      "(task_id) where status = 'finished' order by name, planner)";
  EXPECT_EQ(place_->Value("one.db", digests).size(), 4 * 64 + 3u);
  EXPECT_EQ(place_->Value("one.db", digests), place_->Value("many.db", digests));
  // `dreamer` plays the proposal's mode, 0: the pendulum hangs.
  EXPECT_EQ(place_->Value("one.db",
                          "select max(episode_return) from episode join run using "
                          "(run_id) join task using (task_id) where planner = "
                          "'dreamer' and name = 'pendulum_swingup'"),
            "0.0");
  EXPECT_EQ(place_->Value("one.db",
                          "select count(distinct digest) from episode join run using "
                          "(run_id) where planner = 'random'"),
            "6");
}

TEST_F(EvalTest, InterruptedItGoesOnWithTheNextEpisode) {
  const std::vector<std::string> arguments = {
      "eval", "--env", "cartpole_swingup",     "--planner", "random_shooting",   "--episodes",
      "80",   "--set", "planner.candidates=4", "--set",     "planner.horizon=2", "--jobs",
      "1"};
  const auto with = [&](const std::string& db) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), {"--db", db});
    return all;
  };
  ASSERT_EQ(place_->Runner(with("whole.db")).exit_status, 0);
  const pid_t pid = place_->Start(with("cut.db"));
  for (int i = 0; i < 2000; ++i) {
    const std::string played = place_->Value("cut.db", "select count(*) from episode");
    if (!played.empty() && std::stoi(played) >= 2) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ::kill(pid, SIGINT);
  EXPECT_EQ(place_->Wait(pid).exit_status, 75);
  const int before = std::stoi(place_->Value("cut.db", "select count(*) from episode"));
  EXPECT_LT(before, 80);  // several groups that end together
  const ProgramResult resumed = place_->Runner(with("cut.db"));
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(place_->Value("cut.db", "select result_digest from run"),
            place_->Value("whole.db", "select result_digest from run"));
  EXPECT_EQ(place_->Value("cut.db", "select sum(rows_rolled_back) from segment where segment > 0"),
            "0");
}

TEST_F(EvalTest, TheSimulatorRanksWhatOneStepOfItPromisedJustSo) {
  // One transition of true dynamics, and no value beyond it, is the return of one decision.
  const auto evaluate = [](const std::string& db, std::vector<std::string> more) {
    std::vector<std::string> all = {"eval",
                                    "--env",
                                    "cartpole_balance",
                                    "--planner",
                                    "rollout,mcts_pw,dreamer",
                                    "--episodes",
                                    "2",
                                    "--set",
                                    "rollout.depth=1",
                                    "--db",
                                    db};
    all.insert(all.end(), more.begin(), more.end());
    return place_->Runner(all);
  };
  const ProgramResult ranked =
      evaluate("ranked.db", {"--rank-every", "100", "--rank-decisions", "1"});
  ASSERT_EQ(ranked.exit_status, 0) << ranked.err;
  ASSERT_EQ(evaluate("plain.db", {}).exit_status, 0);
  const auto metric = [](const std::string& planner, const std::string& name) {
    return place_->Value("ranked.db",
                         "select printf('%.6f', value) from scalar join metric using (metric_id) "
                         "join run using (run_id) where planner = '" +
                             planner + "' and metric.name = 'ranking." + name + "'");
  };
  EXPECT_EQ(metric("rollout", "correlation"), "1.000000");
  EXPECT_EQ(metric("rollout", "regret"), "0.000000");
  EXPECT_EQ(metric("rollout", "first_visits"), "0.006667");  // one of 150 candidates
  EXPECT_EQ(metric("rollout", "decisions"), "10.000000");    // two episodes of 500
  EXPECT_NE(metric("mcts_pw", "correlation"), "1.000000");   // its returns differ in depth
  EXPECT_EQ(metric("dreamer", "decisions"), "");
  EXPECT_NE(ranked.out.find("rank correlation"), std::string::npos) << ranked.out;
  // What was tried changed nothing.
  const std::string digests = "select group_concat(result_digest) from run";
  EXPECT_EQ(place_->Value("ranked.db", digests), place_->Value("plain.db", digests));
}

TEST_F(EvalTest, ARankedEvaluationIsARunOfItsOwnWithTheSameEpisodes) {
  const std::vector<std::string> arguments = {"eval",         "1",   "--planner",        "mcts_pw",
                                              "--rank-every", "7",   "--rank-decisions", "5",
                                              "--db",         "e.db"};
  const std::string runs = Value("select count(*) from run");
  const ProgramResult ranked = place_->Runner(arguments);
  ASSERT_EQ(ranked.exit_status, 0) << ranked.err;
  EXPECT_EQ(Value("select count(*) - " + runs + " from run"), "1");
  EXPECT_EQ(Value("select count(distinct result_digest) from run where parent_run_id = 1 and "
                  "planner = 'mcts_pw' and model = 'dreamer' and env_steps_done = 4000"),
            "1");
  EXPECT_EQ(Value("select count(*) from scalar join metric using (metric_id) where run_id = "
                  "(select max(run_id) from run) and name like 'ranking.%'"),
            "5");
  EXPECT_EQ(place_->Runner(arguments).out, ranked.out);
  EXPECT_EQ(Value("select count(*) - " + runs + " from run"), "1");
}

TEST_F(EvalTest, SaysWhatItCannotEvaluate) {
  const std::pair<std::vector<std::string>, const char*> cases[] = {
      {{"eval", "2", "--planner", "dreamer"}, "the trained run is 1"},
      {{"eval", "1"}, "expected --planner NAMES"},
      {{"eval", "--planner", "dreamer"}, "RUN or --env"},
      {{"eval", "1", "--planner", "dreamer", "--seeds", "2"},
       "expected RUN or --seeds, found both"},
      {{"eval", "1", "--planner", "dreamer", "--set", "run.steps=4"},
       "the trained run keeps its settings"},
      {{"eval", "--env", "walker_walk", "--planner", "dreamer", "--model", "dreamer"},
       "needs a trained run"},
  };
  for (const auto& [arguments, message] : cases) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), {"--db", "e.db"});
    const ProgramResult result = place_->Runner(all);
    EXPECT_EQ(result.exit_status, 2) << result.err;
    EXPECT_NE(result.err.find(message), std::string::npos) << result.err;
  }
  const ProgramResult conflict =
      place_->Runner({"eval", "--env", "cartpole_swingup,reacher_easy", "--planner", "random,cem",
                      "--set", "cem.candidates=20", "--set", "cem.elites=100", "--db", "new.db"});
  EXPECT_EQ(conflict.exit_status, 2) << conflict.err;
  EXPECT_NE(conflict.err.find("planner 'cem' cannot be made"), std::string::npos) << conflict.err;
  EXPECT_FALSE(std::filesystem::exists(place_->Path("new.db")));
  const ProgramResult unknown =
      place_->Runner({"eval", "1", "--planner", "mcts_wp", "--db", "e.db"});
  EXPECT_EQ(unknown.exit_status, 66) << unknown.err;
  EXPECT_NE(unknown.err.find("mcts_pw"), std::string::npos) << unknown.err;
}

}  // namespace
}  // namespace dreamsearch
