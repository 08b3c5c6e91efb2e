// child_process.h - starts this program again as a child process.
//
// Workers and probes are new processes, never forks: no database connection, lock
// or thread is carried over. A child has a process group of its own, so that keys
// pressed at the terminal reach the supervisor alone, which decides what to do.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace dreamsearch {

// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor() { Close(); }
  Descriptor(Descriptor&& other) noexcept : fd_(other.Release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    if (this != &other) {
      Close();
      fd_ = other.Release();
    }
    return *this;
  }
  int get() const { return fd_; }
  int Release() {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }
  void Close();

 private:
  int fd_;
};

struct Pipe {
  Descriptor read;   // non-blocking
  Descriptor write;  // blocking
};
Pipe MakePipe();

// A file that lives in memory only, holding `text`, read from its beginning.
Descriptor MemoryFile(const std::string& text);

// What the child finds at descriptor 3: where it reports to its parent.
inline constexpr int kReportDescriptor = 3;

// And at descriptor 4, if it is a worker: its ThreadGrant.
inline constexpr int kThreadsDescriptor = 4;

struct ChildSpec {
  std::vector<std::string> arguments;  // after the program's name
  int input = -1;   // its standard input; -1: /dev/null
  int log = -1;     // its standard output and error; -1: /dev/null
  int report = -1;  // its kReportDescriptor
  int threads = -1;  // its kThreadsDescriptor; -1: none
};
// Throws RunnerError 70 if the system cannot start it.
pid_t StartChild(const ChildSpec& spec);

// "exit status 3", "signal 11 (Segmentation fault)".
std::string DescribeWaitStatus(int status);

// Reads a descriptor to its end. Throws RunnerError 74.
std::string ReadAll(int fd);

// Writes all of `text`; false if the reader is gone.
bool WriteAll(int fd, const std::string& text);

}  // namespace dreamsearch
