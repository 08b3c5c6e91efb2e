// call_site.h - which call of which component is under way.
//
// Kept for whoever must say where a process died or hangs: a signal handler reads it
// (host/processes/crash_report.h). Where episodes take turns on stacks of their own, each has
// its own (host/acting/fiber.h).
#pragma once

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

}  // namespace dreamsearch
