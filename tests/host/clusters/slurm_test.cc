// What Slurm's commands answer.
#include "host/clusters/slurm.h"

#include <gtest/gtest.h>

namespace dreamsearch {
namespace {

TEST(Slurm, AJobsNumberIsReadWithAndWithoutACluster) {
  EXPECT_EQ(JobNumber("12\n"), "12");
  EXPECT_EQ(JobNumber("12;dev\n"), "12");
  EXPECT_EQ(JobNumber("Submitted batch job 12\n"), "");
  EXPECT_EQ(JobNumber(""), "");
}

TEST(Slurm, TheQueueNamesTasksOfArraysAndOtherJobs) {
  const Queue queue = ParseQueue(
      "12|0|RUNNING|node7|None\n"
      "12|1|PENDING||Resources\n"
      "13|N/A|PENDING||Dependency\n"
      "slurm_load_jobs error: something\n"
      "\n");
  ASSERT_EQ(queue.size(), 3u);
  EXPECT_EQ(queue.at("12_0").state, "RUNNING");
  EXPECT_EQ(queue.at("12_0").node, "node7");
  EXPECT_EQ(queue.at("12_0").reason, "");
  EXPECT_EQ(queue.at("12_1").node, "");
  EXPECT_EQ(queue.at("12_1").reason, "Resources");
  EXPECT_EQ(queue.at("13").reason, "Dependency");
}

TEST(Slurm, TheLargestArrayIsTheSitesOrSlurmsDefault) {
  EXPECT_EQ(ParseMaxArraySize("MailProg = /bin/mail\nMaxArraySize            = 251\nMaxJobs = 9\n"),
            251u);
  EXPECT_EQ(ParseMaxArraySize("MaxArraySizes = 251\n"), 1001u);
  EXPECT_EQ(ParseMaxArraySize(""), 1001u);
}

}  // namespace
}  // namespace dreamsearch
