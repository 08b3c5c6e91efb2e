// Which cores there are, and how runs share them.
#include "host/settings/cores.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <string>

#include "host/processes/thread_grant.h"
#include "results/system/error.h"
#include "tests/host/settings/control_group_test.h"

namespace dreamsearch {
namespace {

using Threads = std::map<std::size_t, std::uint32_t>;

using CoresTest = ControlGroupTest;

TEST_F(CoresTest, AProcessHasTheCoresOfItsAffinityMask) {
  // In a child, whose mask is its own.
  EXPECT_EXIT(
      {
        const Cores before = AvailableCores();
        cpu_set_t mask;
        ::sched_getaffinity(0, sizeof mask, &mask);
        int first = 0;
        while (!CPU_ISSET(first, &mask)) ++first;
        const bool more = CPU_COUNT(&mask) > 1;
        CPU_ZERO(&mask);
        CPU_SET(first, &mask);
        ::sched_setaffinity(0, sizeof mask, &mask);
        const Cores one = AvailableCores();
        ::_exit(one.count == 1 && (one.name != before.name) == more ? 0 : 1);
      },
      testing::ExitedWithCode(0), "");
}

TEST_F(CoresTest, TheLeastLimitOfAControlGroupAndThoseAroundItCounts) {
  const auto membership = Write("self", "0::/outer/inner\n");
  EXPECT_TRUE(std::isinf(LimitOfControlGroups(membership, folder_ / "fs").cores));
  Write("fs/outer/inner/cpu.max", "max 100000\n");
  EXPECT_TRUE(std::isinf(LimitOfControlGroups(membership, folder_ / "fs").cores));
  Write("fs/outer/cpu.max", "150000 100000\n");
  EXPECT_EQ(LimitOfControlGroups(membership, folder_ / "fs").cores, 1.5);
  EXPECT_EQ(LimitOfControlGroups(membership, folder_ / "fs").group, "/outer");
  Write("fs/outer/inner/cpu.max", "300000 100000\n");
  EXPECT_EQ(LimitOfControlGroups(membership, folder_ / "fs").cores, 1.5);
  // Seen from within a container.
  Write("fs/cpu.max", "50000 100000\n");
  EXPECT_EQ(LimitOfControlGroups(membership, folder_ / "fs").cores, 0.5);
  EXPECT_EQ(LimitOfControlGroups(Write("self", "0::/../../elsewhere\n"), folder_ / "fs").cores,
            0.5);
}

TEST_F(CoresTest, LimitsOfControlGroupsOfVersion1CountToo) {
  const auto membership = Write("self", "5:memory:/job\n4:cpu,cpuacct:/job\n0::/\n");
  Write("fs/cpu,cpuacct/job/cpu.cfs_quota_us", "-1\n");
  Write("fs/cpu,cpuacct/job/cpu.cfs_period_us", "100000\n");
  EXPECT_TRUE(std::isinf(LimitOfControlGroups(membership, folder_ / "fs").cores));
  Write("fs/cpu,cpuacct/job/cpu.cfs_quota_us", "250000\n");
  EXPECT_EQ(LimitOfControlGroups(membership, folder_ / "fs").cores, 2.5);
}

TEST_F(CoresTest, RunsShareAllCoresTheFirstOnesTakeTheRest) {
  CoreSharing five(5, folder_ / "five");
  EXPECT_EQ(five.Threads(), Threads());
  EXPECT_EQ(five.Enter(), 0u);
  EXPECT_EQ(five.Threads(), (Threads{{0, 5}}));
  five.Enter();
  EXPECT_EQ(five.Threads(), (Threads{{0, 3}, {1, 2}}));
  five.Enter();
  EXPECT_EQ(five.Threads(), (Threads{{0, 2}, {1, 2}, {2, 1}}));
  five.Leave(0);
  EXPECT_EQ(five.Threads(), (Threads{{1, 3}, {2, 2}}));
  EXPECT_EQ(five.Enter(), 0u) << "the first free place";
  for (int i = 0; i < 4; ++i) five.Enter();
  EXPECT_EQ(five.Threads(), (Threads{{0, 1}, {1, 1}, {2, 1}, {3, 1}, {4, 1}, {5, 1}, {6, 1}}))
      << "a run has at least one";
}

TEST_F(CoresTest, TwoCommandsNeverTakeTheSameIdleCore) {
  CoreSharing first(4, folder_ / "places"), second(4, folder_ / "places");
  first.Enter();
  EXPECT_EQ(first.Threads(), (Threads{{0, 4}}));
  EXPECT_EQ(second.Enter(), 1u);
  second.Enter();
  EXPECT_EQ(first.Threads(), (Threads{{0, 2}})) << "it gives them back";
  EXPECT_EQ(second.Threads(), (Threads{{1, 1}, {2, 1}}));
  first.Leave(0);
  EXPECT_EQ(second.Threads(), (Threads{{1, 2}, {2, 2}}));
}

TEST_F(CoresTest, ACommandThatIsKilledLeavesItsCoresToOthers) {
  CoreSharing sharing(4, folder_ / "places");
  sharing.Enter();
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t other = ::fork();
  if (other == 0) {
    CoreSharing killed(4, folder_ / "places");
    killed.Enter();
    if (::write(ready[1], "", 1) == 1) ::pause();
    ::_exit(1);
  }
  char byte;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  EXPECT_EQ(sharing.Threads(), (Threads{{0, 2}}));
  ::kill(other, SIGKILL);
  ::waitpid(other, nullptr, 0);
  EXPECT_EQ(sharing.Threads(), (Threads{{0, 4}}));
}

TEST_F(CoresTest, WithoutTheFileACommandKnowsItsOwnRuns) {
  std::filesystem::create_symlink(Write("target", ""), folder_ / "link");
  for (const char* file : {"no_such_folder/places", "link", "."}) {
    CoreSharing sharing(4, folder_ / file);
    sharing.Enter();
    sharing.Enter();
    EXPECT_EQ(sharing.Threads(), (Threads{{0, 2}, {1, 2}})) << file;
  }
}

TEST_F(CoresTest, ALockOnTheWholeFileStopsNobody) {
  const int file = ::open((folder_ / "places").c_str(), O_RDWR | O_CREAT, 0666);
  struct flock all {};
  all.l_type = F_WRLCK;
  ASSERT_EQ(::fcntl(file, F_OFD_SETLK, &all), 0);
  CoreSharing sharing(4, folder_ / "places");
  const std::size_t place = sharing.Enter();
  EXPECT_GE(sharing.Threads().at(place), 1u);
  ::close(file);
}

TEST(ThreadGrant, AWorkerSeesWhatItsSupervisorGrantsAtOnce) {
  ThreadGrant supervisors;
  ThreadGrant workers(supervisors.TakeDescriptor().Release());
  EXPECT_EQ(workers.threads(), 1u);
  supervisors.Set(7);
  EXPECT_EQ(workers.threads(), 7u);
}

TEST(ThreadGrant, WhatIsNoGrantIsRefused) {
  EXPECT_THROW(ThreadGrant(::open("/dev/null", O_RDONLY)), Failure);
  EXPECT_THROW(ThreadGrant(-1), Failure);
}

}  // namespace
}  // namespace dreamsearch
