// How much memory there is, and how runs share it.
#include "host/settings/memory.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "tests/host/settings/control_group_test.h"

namespace dreamsearch {
namespace {

constexpr std::uint64_t kGigabyte = 1 << 30;

class MemoryTest : public ControlGroupTest {
 protected:
  std::uint64_t Left(const std::string& membership) const {
    return MemoryOfControlGroups(Write("self", membership), folder_ / "fs");
  }
};

TEST_F(MemoryTest, WhatTheTightestGroupLeavesCountsAndUnusedFilePagesAreFree) {
  EXPECT_EQ(Left("0::/outer/inner\n"), kUnknownMemory);
  Write("fs/outer/inner/memory.max", "max\n");
  Write("fs/outer/inner/memory.current", "500\n");
  EXPECT_EQ(Left("0::/outer/inner\n"), kUnknownMemory);
  Write("fs/outer/memory.max", "10000\n");
  Write("fs/outer/memory.current", "4000\n");
  Write("fs/outer/memory.stat", "anon 3000\ninactive_file 700\nactive_file 300\n");
  EXPECT_EQ(Left("0::/outer/inner\n"), 6700u);
  Write("fs/outer/inner/memory.max", "2000\n");
  EXPECT_EQ(Left("0::/outer/inner\n"), 1500u);
  Write("fs/outer/inner/memory.current", "2500\n");  // over it already
  EXPECT_EQ(Left("0::/outer/inner\n"), 0u);
}

TEST_F(MemoryTest, GroupsOfVersion1Count) {
  Write("fs/memory/job/memory.limit_in_bytes", "9000\n");
  Write("fs/memory/job/memory.usage_in_bytes", "1000\n");
  Write("fs/memory/job/memory.stat", "inactive_file 1\ntotal_inactive_file 400\n");
  EXPECT_EQ(Left("5:cpu:/job\n4:memory:/job\n"), 8400u);
}

TEST_F(MemoryTest, AJobOfSlurmHasWhatItWasGiven) {
  ::setenv("SLURM_MEM_PER_NODE", "12", 1);
  EXPECT_EQ(AvailableMemory(), 12u << 20);
  ::unsetenv("SLURM_MEM_PER_NODE");
  ::setenv("SLURM_MEM_PER_CPU", "10", 1);
  ::setenv("SLURM_CPUS_ON_NODE", "2", 1);
  EXPECT_EQ(AvailableMemory(), 20u << 20);
  ::unsetenv("SLURM_MEM_PER_CPU");
  ::unsetenv("SLURM_CPUS_ON_NODE");
  EXPECT_GT(AvailableMemory(), 20u << 20);
}

TEST_F(MemoryTest, ResidentSizeFollowsWhatIsUsedNotWhatIsReserved) {
  const std::uint64_t before = ResidentBytes(::getpid());
  const std::vector<char> used(64 << 20, 'x');
  const std::uint64_t after = ResidentBytes(::getpid());
  EXPECT_GT(after, before + (60 << 20));
  EXPECT_GE(PeakResidentBytes(), after);
  EXPECT_EQ(ResidentBytes(-1), 0u);
}

TEST_F(MemoryTest, JobsFollowTheCoresAndTheMemoryOfARun) {
  ProcessOptions options;
  const auto jobs = [&](std::uint64_t run, std::uint64_t available) {
    return LimitsOf(options, run, 8, available).jobs;
  };
  EXPECT_EQ(jobs(0, 4 * kGigabyte), 8);
  EXPECT_EQ(jobs(kGigabyte, 40 * kGigabyte), 8);
  EXPECT_EQ(jobs(kGigabyte, 4 * kGigabyte), 4);
  EXPECT_EQ(jobs(kGigabyte, kGigabyte / 2), 1);
  EXPECT_EQ(jobs(kGigabyte, kUnknownMemory), 8);
  options.jobs = 6;
  EXPECT_EQ(jobs(kGigabyte, 4 * kGigabyte), 6);
}

TEST_F(MemoryTest, ARunMayTakeItsShareUnlessALimitIsGiven) {
  ProcessOptions options;
  EXPECT_EQ(LimitsOf(options, kGigabyte, 8, 4 * kGigabyte).memory_bytes, kGigabyte);
  EXPECT_EQ(LimitsOf(options, 0, 8, 4 * kGigabyte).memory_bytes, kGigabyte / 2);
  EXPECT_EQ(LimitsOf(options, 0, 8, kUnknownMemory).memory_bytes, 0u);
  options.memory_limit_bytes = 123;
  EXPECT_EQ(LimitsOf(options, kGigabyte, 8, 4 * kGigabyte).memory_bytes, 123u);
  options.memory_limit_bytes = 0;
  EXPECT_EQ(LimitsOf(options, kGigabyte, 8, 4 * kGigabyte).memory_bytes, 0u);
}

}  // namespace
}  // namespace dreamsearch
