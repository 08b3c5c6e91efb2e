// Equal commands give equal digests, whatever interrupts them.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

constexpr char kDigests[] =
    "select group_concat(result_digest) from (select result_digest from run where status = "
    "'finished' order by planner, seed)";

constexpr char kOpenSegment[] = "select pid from segment where ended_utc is null";

class DeterminismTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    const ProgramResult result = place_->Runner(Arguments("reference.db", "2"));
    ASSERT_EQ(result.exit_status, 0) << result.err;
    reference_ = place_->Value("reference.db", kDigests);
    ASSERT_EQ(reference_.size(), 4 * 64 + 3u) << reference_;
  }
  static void TearDownTestSuite() { delete place_; }

  static std::vector<std::string> Arguments(const std::string& db, const std::string& jobs) {
    return TinyRun("walker_walk", "dreamer,mcts_pw", db, {"--seeds", "2", "--jobs", jobs});
  }

  static Workplace* place_;
  static std::string reference_;
};
Workplace* DeterminismTest::place_ = nullptr;
std::string DeterminismTest::reference_;

TEST_F(DeterminismTest, AnotherDatabaseAndOneJobGiveTheSameDigests) {
  const ProgramResult result = place_->Runner(Arguments("one.db", "1"));
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(place_->Value("one.db", kDigests), reference_);
}

TEST_F(DeterminismTest, TwoUpdatesAtATimeAreOneOfHalfTheSteps) {
  std::vector<std::string> twice = Arguments("twice.db", "2");
  std::replace(twice.begin(), twice.end(), std::string("run.train_every=250"),
               std::string("run.train_every=500"));
  twice.insert(twice.end(), {"--set", "run.updates=2"});
  const ProgramResult result = place_->Runner(twice);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(place_->Value("twice.db", kDigests), reference_);
}

TEST_F(DeterminismTest, InterruptedInMidEvaluationAndResumedGivesTheSameDigest) {
  // The first evaluation, before any step: searches, five episodes side by side.
  const auto arguments = [](const std::string& db) {
    std::vector<std::string> all = TinyRun("walker_walk", "mcts_pw", db);
    const std::pair<const char*, const char*> changes[] = {
        {"run.eval_episodes=1", "run.eval_episodes=5"},
        {"planner.simulations=6", "planner.simulations=30"},
        {"4000", "2000"}};
    for (const auto& [from, to] : changes) {
      std::replace(all.begin(), all.end(), std::string(from), std::string(to));
    }
    return all;
  };
  ASSERT_EQ(place_->Runner(arguments("evaluated.db")).exit_status, 0);
  const pid_t pid = place_->Start(arguments("unevaluated.db"));
  for (int i = 0; i < 2000 && place_->Value("unevaluated.db", kOpenSegment).empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ::kill(pid, SIGINT);
  EXPECT_EQ(place_->Wait(pid).exit_status, 75);
  EXPECT_EQ(place_->Value("unevaluated.db", "select count(*) from episode"), "0");
  EXPECT_EQ(place_->Value("unevaluated.db", "select max(to_env_step) from segment"), "0");
  const ProgramResult resumed = place_->Runner({"resume", "--db", "unevaluated.db"});
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(place_->Value("unevaluated.db", kDigests), place_->Value("evaluated.db", kDigests));
  EXPECT_EQ(place_->Value("unevaluated.db", "select count(*) from episode where phase = 1"),
            place_->Value("evaluated.db", "select count(*) from episode where phase = 1"));
}

TEST_F(DeterminismTest, InterruptedInMidEpisodeAndResumedGivesTheSameDigest) {
  const pid_t pid = place_->Start(Arguments("stopped.db", "1"));
  ASSERT_TRUE(place_->WaitForStep("stopped.db", 1100));
  ::kill(pid, SIGINT);
  const ProgramResult stopped = place_->Wait(pid);
  EXPECT_EQ(stopped.exit_status, 75) << stopped.err;
  EXPECT_NE(stopped.err.find("resume --db"), std::string::npos) << stopped.err;
  EXPECT_EQ(place_->Value("stopped.db", "select count(*) from run where status = 'interrupted'"),
            "1");
  const ProgramResult dry = place_->Runner({"resume", "--db", "stopped.db", "--dry-run"});
  EXPECT_EQ(dry.exit_status, 0) << dry.err;
  EXPECT_NE(dry.out.find("would resume run "), std::string::npos) << dry.out;
  const ProgramResult resumed = place_->Runner({"resume", "--db", "stopped.db", "--jobs", "2"});
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(place_->Value("stopped.db", kDigests), reference_);
  EXPECT_EQ(place_->Value("stopped.db",
                          "select max(n) from (select count(*) as n from segment "
                          "group by run_id)"),
            "2");
  EXPECT_EQ(place_->Value("stopped.db", "select count(*) from step"), "8000");
}

// As Slurm and systemd do it: all processes hear it, the worker also from its supervisor.
TEST_F(DeterminismTest, AStopSignalToSupervisorAndWorkerLeavesACheckpoint) {
  const pid_t pid = place_->Start(Arguments("job.db", "1"));
  ASSERT_TRUE(place_->WaitForStep("job.db", 1100));
  const pid_t worker = std::stoi(place_->Value("job.db", kOpenSegment));
  ::kill(worker, SIGUSR1);
  ::kill(worker, SIGTERM);
  ::kill(pid, SIGTERM);
  const ProgramResult stopped = place_->Wait(pid);
  EXPECT_EQ(stopped.exit_status, 75) << stopped.err;
  EXPECT_EQ(place_->Value("job.db", "select status from run where run_id = 1"), "interrupted");
  // The checkpoint is of the step at which it stopped.
  EXPECT_EQ(place_->Value("job.db",
                          "select max(a.env_step) = s.to_env_step and s.to_env_step >= "
                          "1100 from artifact a, segment s where s.run_id = 1 and "
                          "a.run_id = 1 and a.kind = 'checkpoint'"),
            "1");
  const ProgramResult resumed = place_->Runner({"resume", "1", "--db", "job.db"});
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  const std::string digest = "select result_digest from run where run_id = 1";
  EXPECT_EQ(place_->Value("job.db", digest), place_->Value("reference.db", digest));
}

// Its batch script forwards what Slurm may also send to all of its processes.
TEST_F(DeterminismTest, SignalsThatComeTwiceInAJobOfSlurmLeaveACheckpoint) {
  const std::pair<const char*, const char*> variables[] = {{"SLURM_JOB_ID", "15"},
                                                           {"SLURM_ARRAY_JOB_ID", "12"},
                                                           {"SLURM_ARRAY_TASK_ID", "3"},
                                                           {"SLURM_RESTART_COUNT", "2"},
                                                           {"SLURMD_NODENAME", "n1"}};
  for (const auto& [name, value] : variables) ::setenv(name, value, 1);
  const pid_t pid = place_->Start(Arguments("slurm.db", "1"));
  for (const auto& [name, value] : variables) ::unsetenv(name);
  ASSERT_TRUE(place_->WaitForStep("slurm.db", 1100));
  for (const int signal : {SIGUSR2, SIGTERM, SIGXCPU, SIGTERM}) ::kill(pid, signal);
  const ProgramResult stopped = place_->Wait(pid);
  EXPECT_EQ(stopped.exit_status, 75) << stopped.err;
  EXPECT_EQ(place_->Value("slurm.db",
                          "select slurm_job, slurm_restarts, slurm_node, end_reason from segment "
                          "where run_id = 1"),
            "12_3|2|n1|interrupted");
  EXPECT_EQ(place_->Value("slurm.db",
                          "select max(a.env_step) = s.to_env_step from artifact a, segment s where "
                          "s.run_id = 1 and a.run_id = 1 and a.kind = 'checkpoint'"),
            "1");
  const ProgramResult resumed = place_->Runner({"resume", "1", "--db", "slurm.db"});
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(place_->Value("slurm.db",
                          "select slurm_job, slurm_restarts from segment where "
                          "run_id = 1 and segment = 1"),
            "NULL|NULL");
  const std::string digest = "select result_digest from run where run_id = 1";
  EXPECT_EQ(place_->Value("slurm.db", digest), place_->Value("reference.db", digest));
}

// The system repeats it every second once a process has used its processor time.
TEST_F(DeterminismTest, ARepeatedSigxcpuLeavesACheckpoint) {
  const pid_t pid = place_->Start(Arguments("limit.db", "1"));
  ASSERT_TRUE(place_->WaitForStep("limit.db", 1100));
  for (int i = 0; i < 3; ++i) {
    ::kill(pid, SIGXCPU);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  const ProgramResult stopped = place_->Wait(pid);
  EXPECT_EQ(stopped.exit_status, 75) << stopped.err;
  EXPECT_EQ(place_->Value("limit.db",
                          "select max(a.env_step) = s.to_env_step and s.to_env_step >= 1100 from "
                          "artifact a, segment s where s.run_id = 1 and a.run_id = 1 and a.kind = "
                          "'checkpoint'"),
            "1");
}

TEST_F(DeterminismTest, AWorkerWhoseSupervisorDiedLeavesACheckpoint) {
  const pid_t pid = place_->Start(Arguments("orphan.db", "1"));
  ASSERT_TRUE(place_->WaitForStep("orphan.db", 1100));
  ::kill(pid, SIGKILL);
  place_->Wait(pid);
  for (int i = 0; i < 2000 && !place_->Value("orphan.db", kOpenSegment).empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(place_->Value("orphan.db", "select end_reason from segment"), "interrupted");
  EXPECT_EQ(place_->Value("orphan.db",
                          "select max(a.env_step) = s.to_env_step from artifact a, "
                          "segment s where a.kind = 'checkpoint'"),
            "1");
}

TEST_F(DeterminismTest, WorkersKilledAtAnyMomentAndResumedGiveTheSameDigest) {
  const std::string kill_workers = "pkill -KILL -P ";
  for (const int env_step : {500, 1500, 2600, 3500}) {
    const pid_t pid = place_->Start(Arguments("killed.db", "1"));
    if (place_->WaitForStep("killed.db", env_step)) {
      // The supervisor outlives its worker and says what happened. Between two runs it has none.
      int status = 1;
      for (int i = 0; i < 2000 && status != 0; ++i) {
        status = std::system((kill_workers + std::to_string(pid)).c_str());
      }
      ASSERT_EQ(status, 0);
    }
    ::kill(pid, SIGINT);
    place_->Wait(pid);
  }
  const ProgramResult resumed = place_->Runner(Arguments("killed.db", "2"));
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(place_->Value("killed.db", kDigests), reference_);
  EXPECT_EQ(place_->Value("killed.db", "select count(*) from step"), "8000");
}

TEST_F(DeterminismTest, TwoRunnersShareADatabaseWithoutDisturbingEachOther) {
  const pid_t first = place_->Start(Arguments("shared.db", "1"));
  ASSERT_TRUE(place_->WaitForStep("shared.db", 100));
  const ProgramResult second = place_->Runner(Arguments("shared.db", "1"));
  const ProgramResult result = place_->Wait(first);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(second.exit_status, 0) << second.err;
  EXPECT_EQ(place_->Value("shared.db", kDigests), reference_);
  EXPECT_EQ(place_->Value("shared.db", "select count(*) from segment"), "4");
  EXPECT_EQ(place_->Value("shared.db", "select count(*) from run where error <> ''"), "0");
}

}  // namespace
}  // namespace dreamsearch
