// check.h - the laws of planner.h, model.h and environment.h as checks that any component can be
// put through.
//
// `runner check FILE.so` runs them, and so does the author of a plugin in a test of their own
// (gtest.h). Every law has a number, which sdk/README.md explains: C of every component, P of
// planners, M of models, E of environments. A law may have several cases: C3 has one for each end
// of every parameter.
//
// Each case runs in a process of its own, made with fork(): it may crash, hang or fill memory
// without harm to the others. So call Check before the program has started threads.
//
// Errors   what a component does wrong is an Outcome. std::invalid_argument for a Subject that
//          names a parameter which its component does not declare.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "dreamsearch/plugin.h"

namespace dreamsearch::check {

// How far a check goes; each level holds those before it.
enum class Level : std::uint32_t {
  kDescribe = 1,  // it describes itself completely
  kMake = 2,      // it can be made, used once and destroyed
  kLaws = 3,      // it keeps the laws under the given settings
  kExtremes = 4,  // under the ends of every parameter, at other sizes, with hostile numbers too
  kSoak = 5,      // for thousands of calls, without growing
};
const char* LevelName(Level level);  // "describe", "make", "laws", "extremes", "soak"

struct Setting {
  std::string name;
  double number = 0;
  std::string text;  // of a choice, a text or a path
};

// What is checked: a component under the settings given; others have their defaults.
struct Subject {
  const ComponentDescriptor* component = nullptr;
  std::vector<Setting> settings;
  // Of a model: a row's answer may not depend on the number of rows beside it either, to the bit.
  // Without it that is allowed to change the fifth digit.
  bool exact_rows = false;
};

enum class Verdict : std::uint32_t {
  kKept = 0,
  kSkipped = 1,   // the law does not concern the component; `found` says why
  kBroken = 2,    // `expected` and `found` say how
  kCrashed = 3,   // a signal or an exit
  kTimedOut = 4,  // did not end within the time limit
  kTooLarge = 5,  // took more memory than the limit
};
const char* VerdictName(Verdict verdict);

struct Outcome {
  std::string law;    // "P5"
  std::string title;  // "equal seeds give equal bits"
  std::string of;     // the case: "depth = 1000"; empty if the law has one only
  Verdict verdict = Verdict::kKept;
  std::string expected;
  std::string found;   // of kKept a remark, mostly empty
  std::string advice;  // what to do about it
  double seconds = 0;

  bool good() const { return verdict == Verdict::kKept || verdict == Verdict::kSkipped; }
};
// "P5 equal seeds give equal bits (explore): expected ..., found .... Advice."
std::string Describe(const Outcome& outcome);

struct Options {
  Level level = Level::kExtremes;
  std::vector<std::string> only;  // laws by number; empty: all
  double case_seconds = 20;       // of wall time, for one case
  // The same at an end of a parameter's range, where the component may take longer than anybody
  // waits: reaching it keeps the law.
  double extreme_seconds = 5;
  std::uint64_t memory_bytes = 1ull << 30;       // resident, for one case
  bool in_this_process = false;                  // no children, no limits: for a debugger
  std::function<void(const Outcome&)> observer;  // told as soon as a case has ended
};

// Every case of every law of that component's kind, in the order of the laws.
std::vector<Outcome> Check(const Subject& subject, const Options& options = {});

// The law that a plugin loads and describes itself within 100 ms, judged by who loaded it.
Outcome LoadOutcome(double seconds);

struct LawInfo {
  std::string number;
  std::string title;
  std::string kinds;  // "planner", "model", "environment", "model, planner" or "every component"
  std::string advice;
  Level level = Level::kLaws;
};
std::vector<LawInfo> AllLaws();

// Loads a plugin into this process, where it stays. Throws std::runtime_error if it is not a
// plugin of this SDK. The host's own loader refuses more, with longer sentences.
const PluginDescriptor& LoadPlugin(const std::string& path);

}  // namespace dreamsearch::check
