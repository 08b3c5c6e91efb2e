// thread_grant.h - the number of threads that a supervisor leaves a worker, in memory
// that both see.
//
// The supervisor makes it, hands its descriptor to the worker and changes the number
// whenever the cores are shared out anew; the worker looks before each piece of work.
#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

#include "host/processes/child_process.h"
#include "results/system/file_descriptor.h"

namespace dreamsearch {

class ThreadGrant {
 public:
  // Of one thread. Throws Failure 70.
  ThreadGrant();
  // What is behind the descriptor that a supervisor has handed down, which is closed.
  // Throws Failure 70 if that is no grant.
  explicit ThreadGrant(int descriptor);
  ~ThreadGrant();
  ThreadGrant(const ThreadGrant&) = delete;
  ThreadGrant& operator=(const ThreadGrant&) = delete;

  // For the worker, once; it is not needed here any more.
  FileDescriptor TakeDescriptor() { return std::move(descriptor_); }
  const std::atomic<std::uint32_t>& threads() const { return *threads_; }
  void Set(std::uint32_t threads) { threads_->store(threads, std::memory_order_relaxed); }

 private:
  void Map(int descriptor);

  static_assert(std::atomic<std::uint32_t>::is_always_lock_free);

  FileDescriptor descriptor_;
  std::atomic<std::uint32_t>* threads_ = nullptr;
};

}  // namespace dreamsearch
