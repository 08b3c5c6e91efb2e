// child_process.h - starts this program again as a child process.
//
// Workers and probes are new processes, never forks: no database connection, lock
// or thread is carried over. A child has a process group of its own, so that keys
// pressed at the terminal reach the supervisor alone, which decides what to do.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "results/system/file_descriptor.h"

namespace dreamsearch {

// A file that lives in memory only, holding `text`, read from its beginning.
FileDescriptor MemoryFile(const std::string& text);

// What the child finds at descriptor 3: where it reports to its parent.
inline constexpr int kReportDescriptor = 3;

// And at descriptor 4, if it is a worker: its ThreadGrant.
inline constexpr int kThreadsDescriptor = 4;

struct ChildSpec {
  std::vector<std::string> arguments;  // after the program's name
  int input = -1;                      // its standard input; -1: /dev/null
  int log = -1;                        // its standard output and error; -1: /dev/null
  int report = -1;                     // its kReportDescriptor
  int threads = -1;                    // its kThreadsDescriptor; -1: none
};
// In the child: sends it this signal once its parent is gone, also if the parent went before.
void EndWithParent(int signal);
// In the child: whether nobody is left who reads its reports. A signal handler may ask.
bool ParentIsGone();

// Throws Failure 74 if the system has too little left for it, 70 if it cannot start it otherwise.
pid_t StartChild(const ChildSpec& spec);

// Processor seconds a process has used; a stopped process uses none. Negative if
// it is gone.
double ProcessorSeconds(pid_t pid);

// Whether its main thread waits for something that is neither the processor nor a disk, and is not
// stopped.
bool IsAsleep(pid_t pid);

// "exit status 3", "signal 11 (Segmentation fault)".
std::string DescribeWaitStatus(int status);

}  // namespace dreamsearch
