// crash_report.h - says on standard error where a process died.
#pragma once

namespace dreamsearch {

// Begins the line that names the call under way: "*** in planner 'cem' Plan, decision 12".
// Below it stands a backtrace.
inline constexpr char kCrashMark[] = "*** in ";

// From now on a signal that ends the process because of a fault (SIGSEGV, SIGABRT and their like)
// is reported first, on a stack of its own. The process then ends by that signal.
void ReportCrashes();

}  // namespace dreamsearch
