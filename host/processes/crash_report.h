// crash_report.h - says on standard error where a process died.
#pragma once

namespace dreamsearch {

// Begins the line that names the call under way: "*** in planner 'cem' Plan, decision 12".
// Below it stands a backtrace.
inline constexpr char kCrashMark[] = "*** in ";

// Begins what the worker itself writes to the log of its run, so that it is not taken for the last
// words of a plugin.
inline constexpr char kOwnMark[] = "runner: ";

// From now on a signal that ends the process because of a fault (SIGSEGV, SIGABRT and their like)
// is reported first, on a stack of its own. The process then ends by that signal. An exit inside a
// component's call is reported too, without a backtrace.
void ReportCrashes();

}  // namespace dreamsearch
