// stop_signals.h - what asks a supervisor, and by it its workers, to stop.
//
// A signal that was ignored when the program was started (SIGHUP under nohup, SIGINT of a
// background job) stays ignored, in the supervisor and in its workers. A supervisor therefore
// asks its workers with a signal that nobody else uses.
#pragma once

#include <signal.h>

namespace dreamsearch {

// A cluster announces a limit or a pre-emption with one of the last three.
inline constexpr int kStopSignals[] = {SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2, SIGXCPU};

inline int StopRequestSignal() { return SIGRTMIN; }

inline bool IsIgnored(int signal) {
  struct sigaction now {};
  return ::sigaction(signal, nullptr, &now) == 0 && now.sa_handler == SIG_IGN;
}

}  // namespace dreamsearch
