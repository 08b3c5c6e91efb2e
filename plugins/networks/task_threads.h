// task_threads.h - a few threads that work through numbered tasks together.
//
// Which thread runs a task is left to chance, so tasks that are to give the same
// results for any number of threads write apart from each other, and whoever adds up
// what they wrote does it in the order of their numbers.
//
// Who has nothing to do sleeps, at once: an update sleeps some five times, and a thread is
// awake within 50 us, so that spinning could save less than 1% of the shortest updates and
// would take a core from runs that can use it.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

#include "plugins/networks/matrix.h"

namespace dreamsearch::networks {

// How far a task has come, for tasks of the same run that use what it writes. A task may
// wait only for tasks of smaller numbers: those have begun, so the wait ends.
class Progress {
 public:
  // What Await throws when the task it waits for has thrown; ends the waiting task.
  struct Abandoned {};

  // Before the run.
  void Reset() { reached_ = 0; }
  // What the task has written so far may be read by those who await `mark` or less.
  void Reach(Index mark);
  void Abandon() { Reach(kAbandoned); }
  void Await(Index mark);

 private:
  static constexpr Index kAbandoned = -1;
  static constexpr Index kNothing = std::numeric_limits<Index>::max();

  std::mutex mutex_;
  std::condition_variable moved_;
  Index reached_ = 0;
  Index awaited_ = kNothing;  // the least mark that anybody waits for: no others are woken
};

// Reaches `mark` at the end of its scope, or abandons what an exception leaves undone.
class ReachAtEnd {
 public:
  explicit ReachAtEnd(Progress* progress, Index mark = 1) : progress_(progress), mark_(mark) {}
  ~ReachAtEnd() {
    if (std::uncaught_exceptions() > exceptions_) {
      progress_->Abandon();
    } else {
      progress_->Reach(mark_);
    }
  }
  ReachAtEnd(const ReachAtEnd&) = delete;
  ReachAtEnd& operator=(const ReachAtEnd&) = delete;

 private:
  Progress* progress_;
  Index mark_;
  int exceptions_ = std::uncaught_exceptions();
};

class TaskThreads {
 public:
  // As after Resize.
  explicit TaskThreads(Index threads) { Resize(threads); }
  ~TaskThreads() { Resize(1); }
  TaskThreads(const TaskThreads&) = delete;
  TaskThreads& operator=(const TaskThreads&) = delete;

  // Goes on with `threads` in all: the one that calls Run and `threads` - 1 helpers, which
  // sleep between runs and block all signals. With fewer where the system refuses one;
  // less than 1 is 1. Not during a run. Allocates nothing and wakes nobody if there are
  // as many already.
  void Resize(Index threads) noexcept;
  Index threads() const { return static_cast<Index>(helpers_.size()) + 1; }

  // task(i) for every i in [0, count), begun in this order; returns when all have ended.
  // Then throws what a task threw, if any did. A task may end by Progress::Abandoned if
  // another of this run threw; std::logic_error where none did.
  // Allocates nothing.
  template <typename Task>
  void Run(Index count, Task&& task) {
    RunAll(
        count, [](void* context, Index i) { (*static_cast<Task*>(context))(i); }, &task);
  }

 private:
  using Call = void (*)(void* context, Index i);

  void RunAll(Index count, Call call, void* context);
  // What the helper of this number does until it is no longer wanted.
  void Help(std::size_t helper);
  // Takes tasks until none is left. `lock` holds mutex_, also afterwards.
  void Work(std::unique_lock<std::mutex>* lock);

  std::mutex mutex_;
  std::condition_variable begun_, ended_;
  Call call_ = nullptr;
  void* context_ = nullptr;
  Index next_ = 0;   // task to begin
  Index count_ = 0;  // tasks of this run
  Index running_ = 0;
  std::size_t helpers_wanted_ = 0;  // those of greater numbers end
  bool abandoned_ = false;          // a task has ended so
  std::exception_ptr error_;
  std::vector<std::thread> helpers_;
};

}  // namespace dreamsearch::networks
