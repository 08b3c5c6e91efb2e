// task_threads.h - a few threads that work through numbered tasks together.
//
// Which thread runs a task is left to chance, so tasks that are to give the same
// results for any number of threads write apart from each other, and whoever adds up
// what they wrote does it in the order of their numbers.
#pragma once

#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "plugins/model_dreamer/matrix.h"

namespace dreamsearch::dreamer {

class TaskThreads {
 public:
  // `threads` in all: the one that calls Run and `threads` - 1 that sleep between runs.
  explicit TaskThreads(Index threads);
  ~TaskThreads();
  TaskThreads(const TaskThreads&) = delete;
  TaskThreads& operator=(const TaskThreads&) = delete;

  // task(i) for every i in [0, count), begun in this order; returns when all have ended.
  // Then throws what a task threw, if any did. Allocates nothing.
  template <typename Task>
  void Run(Index count, Task&& task) {
    RunAll(
        count, [](void* context, Index i) { (*static_cast<Task*>(context))(i); }, &task);
  }

 private:
  using Call = void (*)(void* context, Index i);

  void RunAll(Index count, Call call, void* context);
  void Help();
  // Takes tasks until none is left. `lock` holds mutex_, also afterwards.
  void Work(std::unique_lock<std::mutex>* lock);

  std::mutex mutex_;
  std::condition_variable begun_, ended_;
  Call call_ = nullptr;
  void* context_ = nullptr;
  Index next_ = 0;   // task to begin
  Index count_ = 0;  // tasks of this run
  Index running_ = 0;
  bool stop_ = false;
  std::exception_ptr error_;
  std::vector<std::thread> helpers_;
};

}  // namespace dreamsearch::dreamer
