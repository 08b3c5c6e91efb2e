// A component that fails costs its run and nothing else. Over 400 lines: one set of faulty plugins.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <thread>
#include <tuple>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

struct Fault {
  const char* planner;
  const char* model;
  const char* status;
  int exit_status;
  const char* message;  // what the error must name
};

class FailureTest : public testing::TestWithParam<Fault> {};

// Arguments of runs on the faulty plugins that take moments, the errors from step 1500 on.
std::vector<std::string> FaultyRun(const std::string& planners, const std::string& models,
                                   const std::string& db,
                                   const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments = {"--env",         "cartpole_balance",
                                        "--planner",     planners,
                                        "--model",       models,
                                        "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR,
                                        "--db",          db,
                                        "--steps",       "2000"};
  for (const char* setting :
       {"run.prefill_steps=1000", "run.pretrain_updates=2", "run.train_every=500",
        "run.batch_size=2", "run.sequence_length=8", "run.eval_episodes=1", "dreamer.hidden=8",
        "dreamer.deterministic=8", "dreamer.stochastic=2", "dreamer.imagination_starts=4",
        "dreamer.horizon=2"}) {
    arguments.insert(arguments.end(), {"--set", setting});
  }
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST_P(FailureTest, EndsItsRunAndTheSweepGoesOn) {
  const Fault& fault = GetParam();
  const Workplace place;
  const std::string planners =
      std::string(fault.planner) == "dreamer" ? "dreamer" : std::string(fault.planner) + ",dreamer";
  const std::string models =
      std::string(fault.model) == "dreamer" ? "dreamer" : std::string(fault.model) + ",dreamer";
  const ProgramResult result =
      place.Runner(FaultyRun(planners, models, "f.db", {"--hang-timeout", "1"}));
  EXPECT_EQ(result.exit_status, fault.exit_status) << result.err;
  const std::string bad =
      std::string("planner = '") + fault.planner + "' and model = '" + fault.model + "'";
  EXPECT_EQ(place.Value("f.db", "select status from run where " + bad), fault.status) << result.err;
  const std::string error = place.Value("f.db", "select error from run where " + bad);
  EXPECT_NE(error.find(fault.message), std::string::npos) << error;
  EXPECT_EQ(place.Value("f.db",
                        "select status from run where planner = 'dreamer' and model = "
                        "'dreamer'"),
            "finished")
      << result.err;
  EXPECT_NE(result.err.find("the same command with --retry"), std::string::npos) << result.err;
}

INSTANTIATE_TEST_SUITE_P(
    Faults, FailureTest,
    testing::Values(Fault{"nan_action", "dreamer", "diverged", 72, "nan_action"},
                    Fault{"outside_action", "dreamer", "failed", 70, "outside_action"},
                    Fault{"throwing_planner", "dreamer", "crashed", 71, "thrown on purpose"},
                    Fault{"segfault_planner", "dreamer", "crashed", 71,
                          "in planner 'segfault_planner' Plan, decision "},
                    Fault{"unset_value", "dreamer", "diverged", 72, "set no value"},
                    Fault{"writes_beside", "dreamer", "failed", 70, "wrote beside the action"},
                    Fault{"exiting_planner", "dreamer", "crashed", 71, "before the run was over"},
                    Fault{"quitting_planner", "dreamer", "crashed", 71,
                          "in planner 'quitting_planner' Plan, decision "},
                    Fault{"unmakeable_planner", "dreamer", "crashed", 71,
                          "in planner 'unmakeable_planner' factory. Log: "},
                    Fault{"hanging_planner", "dreamer", "crashed", 71,
                          "in planner 'hanging_planner' Plan, decision "},
                    Fault{"sleeping_planner", "dreamer", "crashed", 71, "without working"},
                    Fault{"null_planner", "dreamer", "failed", 70, "null_planner"},
                    Fault{"dreamer", "nan_model", "diverged", 72, "nan_model"},
                    Fault{"dreamer", "wrong_size_model", "failed", 70, "wrong_size_model"}),
    [](const auto& tested) {
      return std::string(tested.param.planner) + "_on_" + tested.param.model;
    });

// Whether the file holds `text` within ten seconds.
bool WaitForText(const std::string& path, const std::string& text) {
  for (int i = 0; i < 2000; ++i) {
    std::ifstream file(path);
    const std::string said((std::istreambuf_iterator<char>(file)),
                           std::istreambuf_iterator<char>());
    if (said.find(text) != std::string::npos) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

std::string FolderOfRun(const Workplace& place, int run) {
  return place.Path("f.db.files/" + place.Value("f.db", "select uuid from run where run_id = " +
                                                            std::to_string(run)));
}

// Waits until the planner of the run sleeps.
bool WaitUntilItSleeps(const Workplace& place, int run = 1) {
  const std::string begun = "select 1 from segment where run_id = " + std::to_string(run);
  for (int i = 0; i < 2000 && place.Value("f.db", begun).empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return WaitForText(FolderOfRun(place, run) + "/run.log", "waiting");
}

void KillSleepers(const Workplace& place) {
  for (const std::string& pid : place.Query("f.db",
                                            "select pid from segment where run_id in "
                                            "(select run_id from run where planner = "
                                            "'sleeping_planner' and status = 'running')")) {
    ::kill(std::stoi(pid), SIGKILL);
  }
}

TEST(MemoryLimit, EndsTheRunThatTakesMoreAndTheSweepGoesOn) {
  const Workplace place;
  const ProgramResult result = place.Runner(
      FaultyRun("hoarding_planner,dreamer", "dreamer", "f.db", {"--memory-limit", "400M"}));
  EXPECT_EQ(result.exit_status, 71) << result.err;
  EXPECT_EQ(place.Query("f.db", "select planner, status, exit_code from run order by planner"),
            (std::vector<std::string>{"dreamer|finished|0", "hoarding_planner|killed|71"}))
      << result.err;
  EXPECT_NE(result.err.find("more than --memory-limit allows (419.4 MB)"), std::string::npos)
      << result.err;
}

TEST(MemoryLimit, OfAJobOfSlurmIsWhatTheJobWasGiven) {
  const Workplace place;
  ::setenv("SLURM_MEM_PER_NODE", "400", 1);
  const ProgramResult result =
      place.Runner(FaultyRun("hoarding_planner", "dreamer", "f.db", {"--jobs", "1"}));
  ::unsetenv("SLURM_MEM_PER_NODE");
  EXPECT_EQ(result.exit_status, 71) << result.err;
  EXPECT_NE(result.err.find("more than its share of what was free"), std::string::npos)
      << result.err;
}

TEST(MemoryLimit, HoldsForTheProcessThatAsksComponentsToo) {
  const Workplace place;
  const ProgramResult result =
      place.Runner(FaultyRun("dreamer", "dreamer", "f.db", {"--memory-limit", "10M"}));
  EXPECT_EQ(result.exit_status, 71) << result.err;
  EXPECT_NE(result.err.find("of memory, which is what one run may take"), std::string::npos)
      << result.err;
}

TEST(Nice, LowersThePriorityOfWorkersOnlyIfAsked) {
  for (const int nice : {0, 7}) {
    const Workplace place;
    std::vector<std::string> run = FaultyRun("sleeping_planner", "dreamer", "f.db");
    if (nice != 0) run.insert(run.end(), {"--nice", std::to_string(nice)});
    const pid_t pid = place.Start(run);
    ASSERT_TRUE(WaitUntilItSleeps(place));
    const int worker = std::stoi(place.Value("f.db", "select pid from segment"));
    EXPECT_EQ(::getpriority(PRIO_PROCESS, static_cast<id_t>(worker)),
              ::getpriority(PRIO_PROCESS, 0) + nice);
    KillSleepers(place);
    place.Wait(pid);
  }
}

TEST(StopTest, ARunThatDoesNotEndAtItsTimeLimitIsKilled) {
  const Workplace place;
  // By then it sleeps, and no ten seconds yet, after which it hangs.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  const std::string limit = "9";
#else
  const std::string limit = "3";
#endif
  const ProgramResult result = place.Runner(FaultyRun(
      "sleeping_planner", "dreamer", "f.db", {"--time-limit", limit, "--hang-timeout", "1"}));
  EXPECT_EQ(result.exit_status, 71) << result.err;
  EXPECT_EQ(place.Value("f.db", "select status from run"), "killed") << result.err;
  EXPECT_NE(result.err.find("did not stop within 1 s of its time limit of " + limit + " s"),
            std::string::npos)
      << result.err;
  EXPECT_EQ(place.Value("f.db",
                        "select e.detail = r.error and e.env_step >= 1000 from event e "
                        "join run r using (run_id) where e.kind = r.status"),
            "1");
}

TEST(StopTest, ARunThatDoesNotEndWhenAskedToIsKilled) {
  const Workplace place;
  const pid_t pid =
      place.Start(FaultyRun("sleeping_planner", "dreamer", "f.db", {"--hang-timeout", "1"}));
  ASSERT_TRUE(WaitUntilItSleeps(place));
  ::kill(pid, SIGINT);
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 75) << result.err;
  EXPECT_EQ(place.Value("f.db", "select status from run"), "killed") << result.err;
  EXPECT_NE(result.err.find("did not stop within 1 s of being asked to"), std::string::npos)
      << result.err;
}

TEST(StopTest, ASecondSignalStopsAtOnce) {
  const Workplace place;
  const pid_t pid = place.Start(FaultyRun("sleeping_planner", "dreamer", "f.db"));
  ASSERT_TRUE(WaitUntilItSleeps(place));
  ::kill(pid, SIGINT);
  ASSERT_TRUE(WaitForText(place.Path("err." + std::to_string(pid)), "again to stop at once"));
  ::kill(pid, SIGINT);
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 75) << result.err;
  EXPECT_EQ(place.Value("f.db", "select status from run"), "interrupted") << result.err;
}

TEST(StopTest, ACrashWhileStoppingIsACrash) {
  const Workplace place;
  const pid_t pid = place.Start(FaultyRun("segfault_at_stop_planner", "dreamer", "f.db"));
  ASSERT_TRUE(WaitUntilItSleeps(place));
  ::kill(pid, SIGINT);
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 75) << result.err;
  EXPECT_EQ(place.Value("f.db", "select status from run"), "crashed") << result.err;
  EXPECT_NE(result.err.find("signal 11"), std::string::npos) << result.err;
}

TEST(SupervisorTest, ARepeatedCommandExitsLikeTheRunThatFailedBefore) {
  const Workplace place;
  const std::vector<std::string> arguments = FaultyRun("null_planner", "dreamer", "f.db");
  EXPECT_EQ(place.Runner(arguments).exit_status, 70);
  const ProgramResult again = place.Runner(arguments);
  EXPECT_EQ(again.exit_status, 70) << again.err;
  EXPECT_NE(again.err.find("1 run failed before; repeat the command with --retry"),
            std::string::npos)
      << again.err;
}

TEST(SupervisorTest, AReaderThatLeavesEndsNoSweep) {
  const Workplace place;
  std::string command = "cd " + place.folder().string() + " && " DREAMSEARCH_TEST_BIN_DIR "/runner";
  for (const std::string& argument : FaultyRun("dreamer", "dreamer", "f.db")) {
    command += " " + argument;
  }
  command = "bash -c 'set -o pipefail; " + command + " 2>&1 | head -c 1 > /dev/null'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(place.Value("f.db", "select status from run"), "finished");
}

TEST(SupervisorTest, AStatusThatCannotBeRecordedEndsNoSweepAndIsRecordedLater) {
  const Workplace place;
  const pid_t pid = place.Start(
      FaultyRun("sleeping_planner", "dreamer", "f.db", {"--seeds", "2", "--jobs", "2"}));
  const std::string err = place.Path("err." + std::to_string(pid));
  pid_t workers[2];
  for (const int run : {1, 2}) {
    ASSERT_TRUE(WaitUntilItSleeps(place, run));
    workers[run - 1] = std::stoi(
        place.Value("f.db", "select pid from segment where run_id = " + std::to_string(run)));
  }
  // A database that is not where it was is not written to.
  std::filesystem::rename(place.Path("f.db"), place.Path("moved"));
  ::kill(workers[0], SIGKILL);
  ASSERT_TRUE(WaitForText(err, "cannot record yet what became of cartpole_balance"));
  std::filesystem::rename(place.Path("moved"), place.Path("f.db"));
  const std::string status = "select status from run where run_id = ";
  for (int i = 0; i < 2000 && place.Value("f.db", status + "1") != "killed"; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(place.Value("f.db", status + "1"), "killed");
  EXPECT_EQ(place.Value("f.db", status + "2"), "running");

  std::filesystem::rename(place.Path("f.db"), place.Path("moved"));
  ::kill(workers[1], SIGKILL);
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 74) << result.err;
  EXPECT_NE(result.err.find("f.db: killed cartpole_balance sleeping_planner seed 1"),
            std::string::npos)
      << result.err;
}

TEST(SupervisorTest, ARunThatCannotBeStartedCostsItselfAlone) {
  const Workplace place;
  place.Runner(FaultyRun("null_planner", "dreamer", "f.db", {"--seeds", "2"}));
  const std::string log = FolderOfRun(place, 1) + "/run.log";
  std::filesystem::remove(log);
  std::filesystem::create_directory(log);
  const ProgramResult result = place.Runner(
      {"resume", "--retry", "--db", "f.db", "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
  EXPECT_EQ(result.exit_status, 74) << result.err;
  EXPECT_NE(place.Value("f.db", "select error from run where run_id = 1").find(log),
            std::string::npos)
      << result.err;
  EXPECT_EQ(place.Value("f.db", "select group_concat(status) from run"), "interrupted,failed");
  EXPECT_EQ(place.Value("f.db", "select count(*) from segment where run_id = 2"), "2");
}

// A second runner on the same runs comes upon the failure of one that the first has planned.
TEST(TwoRunnersTest, ARunThatAnotherRunnerSawFailIsSkipped) {
  const Workplace place;
  const pid_t first =
      place.Start(FaultyRun("sleeping_planner,null_planner", "dreamer", "f.db", {"--jobs", "1"}));
  ASSERT_TRUE(WaitUntilItSleeps(place));
  const ProgramResult second = place.Runner(FaultyRun("null_planner", "dreamer", "f.db"));
  EXPECT_EQ(second.exit_status, 70) << second.err;
  KillSleepers(place);
  const ProgramResult result = place.Wait(first);
  EXPECT_EQ(result.exit_status, 71) << result.err;
  EXPECT_NE(result.err.find("skipped cartpole_balance null_planner seed 0"), std::string::npos)
      << result.err;
  EXPECT_EQ(place.Value("f.db",
                        "select count(*) from segment join run using (run_id) "
                        "where planner = 'null_planner'"),
            "1");
}

// `runner status`, or another runner, asks at the moment at which the worker takes it.
TEST(LockTest, WhoAsksAboutTheLockKeepsNobodyFromIt) {
  const Workplace place;
  place.Runner(FaultyRun("null_planner", "dreamer", "f.db"));
  const int lock = ::open((FolderOfRun(place, 1) + "/lock").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(::flock(lock, LOCK_SH), 0);
  const pid_t pid = place.Start(
      {"resume", "--retry", "--db", "f.db", "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
  ASSERT_TRUE(WaitForText(place.Path("err." + std::to_string(pid)), "started "));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ::close(lock);
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 70) << result.err;
  EXPECT_NE(result.err.find("null_planner"), std::string::npos) << result.err;
  EXPECT_EQ(place.Value("f.db", "select count(*) from segment"), "2");
}

// A tiny training with components of the plugin `faulty`.
std::vector<std::string> FaultyTraining(const std::string& environment, const std::string& model,
                                        const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments = {"--env",          environment,
                                        "--planner",      "random",
                                        "--model",        model,
                                        "--eval-planner", "dreamer",
                                        "--steps",        "100",
                                        "--db",           "f.db",
                                        "--plugin-path",  DREAMSEARCH_FAULTY_PLUGIN_DIR};
  for (const char* setting : {"run.action_repeat=1", "run.prefill_steps=20",
                              "run.sequence_length=4", "run.eval_episodes=1"}) {
    arguments.insert(arguments.end(), {"--set", setting});
  }
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(DeclaredValues, OfAnEnvironmentAreCheckedBeforeAnythingIsWritten) {
  const std::pair<const char*, const char*> cases[] = {
      {"no_steps", "'no_steps' says episode_steps = 0, expected at least 1"},
      {"short_bounds", "says action_low.size = 1, expected action_size = 2 numbers"},
      {"nan_bound", "says action_high[1] = nan, expected a finite number"},
      {"equal_bounds", "says action_high[1] = -1, expected a finite number above action_low[1]"},
      {"odd_parts", "says observation_size = 1, expected the sum of its observation parts, 2"}};
  const Workplace place;
  for (const auto& [environment, message] : cases) {
    const ProgramResult dry =
        place.Runner(FaultyTraining(environment, "idle_model", {"--dry-run"}));
    EXPECT_EQ(dry.exit_status, 69) << dry.err;
    EXPECT_NE(dry.err.find(message), std::string::npos) << dry.err;
    EXPECT_NE(dry.err.find("plugin faulty"), std::string::npos) << dry.err;
  }
  const ProgramResult real = place.Runner(FaultyTraining("no_steps", "idle_model"));
  EXPECT_EQ(real.exit_status, 69) << real.err;
  EXPECT_TRUE(std::filesystem::is_empty(place.folder()));
}

// Eight decisions of 0.2 s each, without a sign of life between them.
TEST(HangTest, EachOfTheDecisionsOfAnEvaluationHasTheTimeOfOne) {
  const Workplace place;
  std::vector<std::string> arguments =
      FaultyTraining("good_environment", "idle_model", {"--hang-timeout", "1"});
  const std::pair<const char*, const char*> changes[] = {
      {"dreamer", "slow_planner"},
      {"100", "20"},
      {"run.action_repeat=1", "run.action_repeat=5"},
      {"run.sequence_length=4", "run.sequence_length=2"},
      {"run.eval_episodes=1", "run.eval_episodes=8"}};
  for (const auto& [from, to] : changes) {
    std::replace(arguments.begin(), arguments.end(), std::string(from), std::string(to));
  }
  const ProgramResult result = place.Runner(arguments);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(place.Value("f.db", "select status from run"), "finished");
  EXPECT_EQ(place.Value("f.db", "select count(*) from episode where phase = 1"), "24");
}

TEST(DeclaredValues, OfAModelCostItsRunAlone) {
  const Workplace place;
  const ProgramResult result =
      place.Runner(FaultyTraining("good_environment", "no_latent,odd_latent,idle_model"));
  EXPECT_EQ(result.exit_status, 69) << result.err;
  const auto run = [&](const std::string& model, const std::string& column) {
    return place.Value("f.db", "select " + column + " from run where model = '" + model + "'");
  };
  EXPECT_EQ(run("idle_model", "status"), "finished") << result.err;
  EXPECT_EQ(run("no_latent", "exit_code"), "69");
  EXPECT_NE(run("no_latent", "error").find("says latent_bytes = 0, expected a multiple of 64"),
            std::string::npos)
      << result.err;
  EXPECT_NE(run("odd_latent", "error").find("says latent_bytes = 72"), std::string::npos);
}

TEST(DeclaredValues, OfAStepAndAnEpisodeAreCheckedInEveryRun) {
  const std::tuple<const char*, int, const char*> cases[] = {
      {"unset_reward", 72, "a reward was not set"},
      {"half_discount", 69, "gave a discount of 0.5, expected 0 at a terminal state and 1"},
      {"false_return", 69, "says that returns lie in [-2, -1]"},
      {"stray_observation", 70, "wrote beside its observation (1 numbers)"}};
  for (const auto& [environment, code, message] : cases) {
    const Workplace place;
    const ProgramResult result = place.Runner(FaultyTraining(environment, "idle_model"));
    EXPECT_EQ(result.exit_status, code) << environment << result.err;
    EXPECT_NE(result.err.find(message), std::string::npos) << result.err;
  }
}

TEST(InProcess, WorksWithoutAChildAndRecordsTheSame) {
  const Workplace place;
  const ProgramResult result =
      place.Runner(FaultyTraining("good_environment", "idle_model", {"--jobs", "0"}));
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_NE(result.err.find("working in this process on good_environment"), std::string::npos)
      << result.err;
  EXPECT_EQ(place.Value("f.db", "select status from run"), "finished");
  const std::string digest = place.Value("f.db", "select result_digest from run");
  const Workplace other;
  other.Runner(FaultyTraining("good_environment", "idle_model"));
  EXPECT_EQ(other.Value("f.db", "select result_digest from run"), digest);
  // What fails is recorded too.
  const Workplace third;
  const ProgramResult failed =
      third.Runner(FaultyTraining("half_discount", "idle_model", {"--jobs", "0"}));
  EXPECT_EQ(failed.exit_status, 69) << failed.err;
  EXPECT_EQ(third.Value("f.db", "select status from run"), "failed");
}

// The plugin's bytes change and nothing else: as after a rebuild.
class Rebuilt : public testing::Test {
 protected:
  Rebuilt() {
    std::filesystem::create_directory(place_.Path("plugins"));
    std::filesystem::copy_file(DREAMSEARCH_FAULTY_PLUGIN_DIR "/faulty.so", plugin_);
  }
  ProgramResult Run(const std::string& planner, const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = FaultyTraining("good_environment", "idle_model", more);
    std::replace(arguments.begin(), arguments.end(), std::string(DREAMSEARCH_FAULTY_PLUGIN_DIR),
                 place_.Path("plugins"));
    std::replace(arguments.begin(), arguments.end(), std::string("random"), planner);
    return place_.Runner(arguments);
  }
  void Rebuild() const { std::ofstream(plugin_, std::ios::app) << "rebuilt"; }

  const Workplace place_;
  const std::string plugin_ = place_.Path("plugins/faulty.so");
};

TEST_F(Rebuilt, PluginIsNoticedOnFinishedRunsAndNotPooledWithoutAWord) {
  ASSERT_EQ(Run("half_actor", {}).exit_status, 0);
  Rebuild();
  const ProgramResult again = Run("half_actor", {});
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_NE(again.err.find("finished before something changed: plugin faulty"), std::string::npos)
      << again.err;
  const ProgramResult more = Run("half_actor", {"--seeds", "2"});
  EXPECT_EQ(more.exit_status, 69) << more.err;
  EXPECT_NE(more.err.find("Use another --study, or --replace"), std::string::npos) << more.err;
  EXPECT_EQ(place_.Value("f.db", "select count(*) from run"), "1");
  EXPECT_EQ(Run("half_actor", {"--seeds", "2", "--replace"}).exit_status, 0);
  EXPECT_EQ(place_.Value("f.db", "select group_concat(seed) from run"), "0,1");
}

// The advice of one command, followed, ends the matter.
TEST_F(Rebuilt, PluginThatHadFailedStartsOverWithTheOneFlagThatIsAdvised) {
  ASSERT_EQ(Run("null_planner", {}).exit_status, 70);
  EXPECT_NE(Run("null_planner", {}).err.find("with --retry to try again"), std::string::npos);
  Rebuild();
  const ProgramResult advice = Run("null_planner", {});
  EXPECT_EQ(advice.exit_status, 70);
  EXPECT_NE(advice.err.find("--replace starts it over"), std::string::npos) << advice.err;
  EXPECT_NE(advice.err.find("repeat the command with --replace"), std::string::npos) << advice.err;
  const ProgramResult over = Run("null_planner", {"--replace"});
  EXPECT_NE(over.err.find("1 to start over"), std::string::npos) << over.err;
  EXPECT_EQ(place_.Value("f.db", "select max(segment) from segment"), "0");
}

TEST(DeclaredValues, AnEpisodeEndsWhenTheEnvironmentSaidItWould) {
  const Workplace place;
  for (const char* environment : {"endless", "endless_training"}) {
    const ProgramResult result = place.Runner(FaultyTraining(environment, "idle_model"));
    EXPECT_EQ(result.exit_status, 69) << result.err;
    EXPECT_NE(result.err.find("goes on after 10"), std::string::npos) << result.err;
  }
}

}  // namespace
}  // namespace dreamsearch
