// call_site.h - which call of which component is under way.
//
// Kept for whoever must say where a process died or hangs: a signal handler reads it
// (host/processes/crash_report.h). Where episodes take turns on stacks of their own, each has
// its own (host/acting/fiber.h).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace dreamsearch {

struct CallSite {
  const char* kind = "";       // "model"; "" where the name says it
  const char* name = nullptr;  // "dreamer", "planner 'cem'"; null: no component is being called
  const char* call = "";       // "Imagine"
  const char* counted = "";    // what `number` counts: "decision"; "": nothing
  std::uint64_t number = 0;
};

// Of each thread: evaluations play on several.
inline thread_local CallSite call_site;

class CallScope {
 public:
  explicit CallScope(const CallSite& site) : before_(call_site) { call_site = site; }
  ~CallScope() { call_site = before_; }
  CallScope(const CallScope&) = delete;
  CallScope& operator=(const CallScope&) = delete;

 private:
  const CallSite before_;
};

// Where threads are for which another waits; null where no such thread is.
inline std::array<std::atomic<const CallSite*>, 64> sites_waited_for;

// While it lives, the call site of its thread is told where a thread is asked that is in no
// component's call itself: what hangs is here. One too many is not told of.
class SiteWaitedFor {
 public:
  SiteWaitedFor() {
    for (auto& place : sites_waited_for) {
      const CallSite* free = nullptr;
      if (!place.compare_exchange_strong(free, &call_site)) continue;
      place_ = &place;
      return;
    }
  }
  ~SiteWaitedFor() {
    if (place_ != nullptr) *place_ = nullptr;
  }
  SiteWaitedFor(const SiteWaitedFor&) = delete;
  SiteWaitedFor& operator=(const SiteWaitedFor&) = delete;

 private:
  std::atomic<const CallSite*>* place_ = nullptr;
};

// Where this thread is or, if it is in no component's call, one of those that are waited for. For
// a signal handler, when nothing goes on.
inline CallSite CallSiteUnderWay() {
  if (call_site.name != nullptr) return call_site;
  for (const auto& place : sites_waited_for) {
    const CallSite* other = place;
    if (other != nullptr && other->name != nullptr) return *other;
  }
  return {};
}

}  // namespace dreamsearch
