#include "plugins/networks/task_threads.h"

#include <pthread.h>

#include <algorithm>
#include <csignal>
#include <stdexcept>
#include <utility>

namespace dreamsearch::networks {

void Progress::Reach(Index mark) {
  const std::lock_guard lock(mutex_);
  reached_ = mark;
  if (mark < awaited_ && mark != kAbandoned) return;
  awaited_ = kNothing;
  moved_.notify_all();
}

void Progress::Await(Index mark) {
  std::unique_lock lock(mutex_);
  while (reached_ < mark) {
    if (reached_ == kAbandoned) throw Abandoned();
    awaited_ = std::min(awaited_, mark);
    moved_.wait(lock);
  }
}

void TaskThreads::Resize(Index threads) noexcept {
  const auto wanted = static_cast<std::size_t>(std::max<Index>(threads, 1) - 1);
  if (wanted == helpers_.size()) return;
  {
    const std::lock_guard lock(mutex_);
    helpers_wanted_ = wanted;
  }
  if (wanted < helpers_.size()) {
    begun_.notify_all();
    for (; helpers_.size() > wanted; helpers_.pop_back()) helpers_.back().join();
    return;
  }
  // Signals are for the thread that was there before.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, &before);
  try {
    helpers_.reserve(wanted);
    while (helpers_.size() < wanted) {
      helpers_.emplace_back([this, helper = helpers_.size()] { Help(helper); });
    }
  } catch (const std::exception&) {  // no thread or no memory for one: fewer will do
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

void TaskThreads::RunAll(Index count, Call call, void* context) {
  std::unique_lock lock(mutex_);
  call_ = call;
  context_ = context;
  next_ = 0;
  count_ = count;
  // No more than there is work for.
  for (Index i = 1; i < std::min(count, threads()); ++i) begun_.notify_one();
  Work(&lock);
  ended_.wait(lock, [this] { return running_ == 0; });
  const bool abandoned = std::exchange(abandoned_, false);
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  if (abandoned) throw std::logic_error("a task waited for one that an earlier run abandoned");
}

void TaskThreads::Help(std::size_t helper) {
  std::unique_lock lock(mutex_);
  while (true) {
    begun_.wait(lock, [&] { return helper >= helpers_wanted_ || next_ < count_; });
    if (helper >= helpers_wanted_) return;
    Work(&lock);
    if (running_ == 0) ended_.notify_one();
  }
}

void TaskThreads::Work(std::unique_lock<std::mutex>* lock) {
  while (next_ < count_) {
    const Index task = next_++;
    ++running_;
    lock->unlock();
    std::exception_ptr error;
    bool abandoned = false;
    try {
      call_(context_, task);
    } catch (const Progress::Abandoned&) {
      abandoned = true;
    } catch (...) {
      error = std::current_exception();
    }
    lock->lock();
    --running_;
    abandoned_ |= abandoned;
    if (error && !error_) error_ = error;
  }
}

}  // namespace dreamsearch::networks
