// Tasks on several threads, whose number may change.
#include "plugins/networks/task_threads.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace dreamsearch::networks {
namespace {

bool Within10Seconds(const std::function<bool()>& holds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::yield();
  }
  return true;
}

// Ids of the threads of this process.
std::set<std::string> Threads() {
  std::set<std::string> threads;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task")) {
    threads.insert(entry.path().filename());
  }
  return threads;
}

// How many there are without helpers. ThreadSanitizer has one of its own from the first on.
std::size_t ThreadsWithoutHelpers() {
#if defined(__SANITIZE_THREAD__)
  std::thread([] {}).join();
  return 2;
#else
  return 1;
#endif
}

// The signals that a thread blocks, a bit each.
std::uint64_t BlockedSignals(const std::string& thread) {
  std::ifstream status("/proc/self/task/" + thread + "/status");
  for (std::string word; status >> word;) {
    if (word == "SigBlk:" && status >> word) return std::strtoull(word.c_str(), nullptr, 16);
  }
  return 0;
}

// Whether `count` tasks of one run are under way at the same moment.
bool RunAtOnce(TaskThreads* pool, Index count) {
  std::atomic<Index> begun{0};
  std::atomic<bool> met{true};
  pool->Run(count, [&](Index) {
    ++begun;
    if (!Within10Seconds([&] { return begun == count; })) met = false;
  });
  return met;
}

TEST(TaskThreads, RunEveryTaskOnceAndThrowWhatOneThrew) {
  for (const Index threads : {1, 2, 4}) {
    TaskThreads pool(threads);
    for (const Index count : {0, 1, 3, 100}) {
      std::vector<int> calls(static_cast<std::size_t>(count));
      pool.Run(count, [&](Index i) { ++calls[static_cast<std::size_t>(i)]; });
      EXPECT_EQ(calls, std::vector<int>(static_cast<std::size_t>(count), 1));
      if (count == 0) continue;
      std::atomic<Index> ended{0};
      EXPECT_THROW(pool.Run(count,
                            [&](Index i) {
                              ++ended;
                              if (i == count / 2) throw std::runtime_error("task");
                            }),
                   std::runtime_error);
      EXPECT_EQ(ended.load(), count) << "the others ran all the same";
    }
  }
}

TEST(TaskThreads, TasksWaitForWhatEarlierOnesWrite) {
  constexpr Index kSteps = 1000;
  for (const Index threads : {1, 2, 4}) {
    TaskThreads pool(threads);
    for (int repeat = 0; repeat < 20; ++repeat) {
      Progress progress;
      std::vector<Index> written(kSteps, -1), read(kSteps, -1);
      pool.Run(3, [&](Index task) {
        if (task == 0) {
          const ReachAtEnd all(&progress, kSteps);
          for (Index i = 0; i < kSteps; ++i) {
            written[static_cast<std::size_t>(i)] = i;
            progress.Reach(i + 1);
          }
          return;
        }
        for (Index i = task - 1; i < kSteps; i += 2) {
          progress.Await(i + 1);
          read[static_cast<std::size_t>(i)] = written[static_cast<std::size_t>(i)];
        }
      });
      EXPECT_EQ(read, written);
    }
  }
}

TEST(TaskThreads, ATaskThatThrowsLeavesNobodyWaiting) {
  for (const Index threads : {1, 2, 4}) {
    TaskThreads pool(threads);
    Progress progress;
    std::atomic<Index> used{0};
    const auto run = [&] {
      pool.Run(4, [&](Index task) {
        if (task == 0) {
          const ReachAtEnd all(&progress);
          throw std::runtime_error("the first");
        }
        progress.Await(1);
        ++used;
      });
    };
    EXPECT_THROW(run(), std::runtime_error);
    EXPECT_EQ(used.load(), 0);
    // What nobody threw in this run is not passed over either.
    EXPECT_THROW(pool.Run(1, [&](Index) { progress.Await(1); }), std::logic_error);
    pool.Run(1, [&](Index) { ++used; });
    EXPECT_EQ(used.load(), 1);
  }
}

TEST(TaskThreads, AsManyTasksRunAtOnceAsItWasResizedTo) {
  TaskThreads pool(1);
  for (const Index threads : {2, 5, 3, 1, 4, 4}) {
    pool.Resize(threads);
    EXPECT_EQ(pool.threads(), threads);
    EXPECT_TRUE(RunAtOnce(&pool, threads)) << threads;
  }
}

TEST(TaskThreads, ManyResizesLeaveEveryTaskRunOnceAndNoThreadTooMany) {
  TaskThreads pool(3);
  for (int repeat = 0; repeat < 500; ++repeat) {
    const Index threads = 1 + (repeat * 7) % 5;
    pool.Resize(threads);
    std::vector<int> calls(40);
    std::mutex mutex;
    std::set<std::thread::id> seen;
    pool.Run(std::ssize(calls), [&](Index i) {
      ++calls[static_cast<std::size_t>(i)];
      const std::lock_guard lock(mutex);
      seen.insert(std::this_thread::get_id());
    });
    ASSERT_EQ(calls, std::vector<int>(40, 1)) << "resize " << repeat;
    ASSERT_LE(std::ssize(seen), threads) << "resize " << repeat;
  }
}

TEST(TaskThreads, ShrunkOrDestroyedItLeavesNoThreadBehind) {
  // The kernel lists a thread for a moment after it was joined: those of the tests before.
  const std::size_t before = ThreadsWithoutHelpers();
  ASSERT_TRUE(Within10Seconds([&] { return Threads().size() == before; }));
  {
    TaskThreads pool(6);
    EXPECT_EQ(Threads().size(), before + 5);
    pool.Resize(2);
    EXPECT_TRUE(Within10Seconds([&] { return Threads().size() == before + 1; }));
    pool.Resize(0);
    EXPECT_EQ(pool.threads(), 1);
    EXPECT_TRUE(Within10Seconds([&] { return Threads().size() == before; }));
    pool.Resize(3);
  }
  EXPECT_TRUE(Within10Seconds([&] { return Threads().size() == before; }));
}

TEST(TaskThreads, HelpersBlockSignalsAndTheCallerTakesThemAsBefore) {
  ThreadsWithoutHelpers();
  const std::set<std::string> before = Threads();
  const std::string self = std::to_string(::gettid());
  const std::uint64_t blocked = BlockedSignals(self);
  TaskThreads pool(2);
  pool.Resize(4);
  EXPECT_EQ(BlockedSignals(self), blocked);
  int helpers = 0;
  for (const std::string& thread : Threads()) {
    if (before.count(thread) != 0) continue;
    ++helpers;
    for (const int signal : {SIGINT, SIGTERM, SIGUSR1, SIGHUP}) {
      EXPECT_NE(BlockedSignals(thread) & (std::uint64_t{1} << (signal - 1)), 0u) << signal;
    }
  }
  EXPECT_EQ(helpers, 3);
}

// The sanitizers need more address space than the limit leaves.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(TaskThreads, AThreadThatTheSystemRefusesMeansFewerThreads) {
  const auto with_little_memory = [] {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit{};
    ::getrlimit(RLIMIT_AS, &limit);
    const rlimit before = limit;
    // Room for two stacks or so.
    limit.rlim_cur = pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + (20 << 20);
    ::setrlimit(RLIMIT_AS, &limit);
    TaskThreads pool(1);
    pool.Resize(200);
    if (pool.threads() >= 200) return 1;
    std::vector<int> calls(1000);
    pool.Run(std::ssize(calls), [&](Index i) { ++calls[static_cast<std::size_t>(i)]; });
    if (calls != std::vector<int>(1000, 1)) return 2;
    ::setrlimit(RLIMIT_AS, &before);
    pool.Resize(200);
    return pool.threads() == 200 ? 0 : 3;
  };
  EXPECT_EXIT(::_exit(with_little_memory()), testing::ExitedWithCode(0), "");
}
#endif

}  // namespace
}  // namespace dreamsearch::networks
