#include "plugins/env_gym/python_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <utility>

namespace dreamsearch::gym {
namespace {

constexpr int kChildRequests = 3;  // as bridge.py has them
constexpr int kChildAnswers = 4;
constexpr std::uint32_t kLongestFrame = 1u << 30;

// To wake a sleeper on an idle core costs more than many a step takes, so this side looks for the
// answer so long before it sleeps; whoever else has work for the core goes first.
constexpr std::chrono::microseconds kLooking(200);

void LookFor(int descriptor) {
  const auto end = std::chrono::steady_clock::now() + kLooking;
  pollfd asked = {.fd = descriptor, .events = POLLIN, .revents = 0};
  while (::poll(&asked, 1, 0) == 0 && std::chrono::steady_clock::now() < end) ::sched_yield();
}

struct Pipe {
  int read = -1;
  int write = -1;
  Pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) {
      throw ProcessError(std::string("cannot make a pipe: ") + std::strerror(errno));
    }
    // Away from the numbers that the process has them under.
    read = ::fcntl(ends[0], F_DUPFD_CLOEXEC, 10);
    write = ::fcntl(ends[1], F_DUPFD_CLOEXEC, 10);
    ::close(ends[0]);
    ::close(ends[1]);
    if (read < 0 || write < 0) {
      Close(&read);
      Close(&write);
      throw ProcessError(std::string("cannot make a pipe: ") + std::strerror(errno));
    }
  }
  static void Close(int* descriptor) {
    if (*descriptor >= 0) ::close(*descriptor);
    *descriptor = -1;
  }
  ~Pipe() {
    Close(&read);
    Close(&write);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
};

pid_t Spawn(const std::string& interpreter, const std::string& program, int requests, int answers) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, 2, 1);  // what it prints goes to the run's log
  ::posix_spawn_file_actions_adddup2(&actions, requests, kChildRequests);
  ::posix_spawn_file_actions_adddup2(&actions, answers, kChildAnswers);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  // A group of its own: Ctrl-C is for the run, which still needs its environment then.
  sigset_t none;
  ::sigemptyset(&none);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK);
  std::string texts[] = {interpreter, "-u", "-c", program};
  char* arguments[] = {texts[0].data(), texts[1].data(), texts[2].data(), texts[3].data(), nullptr};
  pid_t pid = -1;
  const int error =
      ::posix_spawnp(&pid, interpreter.c_str(), &actions, &attributes, arguments, ::environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  if (error != 0) {
    throw ProcessError("cannot start the interpreter '" + interpreter +
                       "': " + std::strerror(error));
  }
  return pid;
}

}  // namespace

PythonProcess::PythonProcess(const std::string& interpreter, const std::string& program)
    : interpreter_(interpreter) {
  Pipe requests, answers;
  pid_ = Spawn(interpreter, program, requests.read, answers.write);
  requests_ = std::exchange(requests.write, -1);
  answers_ = std::exchange(answers.read, -1);
}

PythonProcess::~PythonProcess() {
  ::close(requests_);  // it ends at the end of its requests
  ::close(answers_);
  WaitForEnd();
}

int PythonProcess::WaitForEnd() {
  int status = 0;
  if (pid_ <= 0) return status;
  constexpr int kPatience = 200;  // of 10 ms
  for (int i = 0; i < kPatience && ::waitpid(pid_, &status, WNOHANG) == 0; ++i) {
    if (i + 1 == kPatience) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, &status, 0);
      break;
    }
    ::usleep(10000);
  }
  pid_ = -1;
  return status;
}

void PythonProcess::FailAsItEnded(const char* what) {
  const int status = WaitForEnd();
  std::string text = interpreter_ + " ended while " + what;
  if (WIFEXITED(status)) text += ", exit " + std::to_string(WEXITSTATUS(status));
  if (WIFSIGNALED(status)) text += std::string(", by signal ") + ::strsignal(WTERMSIG(status));
  throw ProcessError(text + "; what it printed is in the run's log");
}

void PythonProcess::Read(char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t n = ::read(answers_, data, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) FailAsItEnded("it was to answer");
    data += n;
    size -= static_cast<std::size_t>(n);
  }
}

std::string_view PythonProcess::Ask(char kind, std::string_view body) {
  if (pid_ <= 0) throw ProcessError(interpreter_ + " has ended");
  const auto length = static_cast<std::uint32_t>(body.size() + 1);
  frame_.resize(sizeof length + length);
  std::memcpy(frame_.data(), &length, sizeof length);
  frame_[sizeof length] = kind;
  std::copy(body.begin(), body.end(), frame_.data() + sizeof length + 1);
  for (std::size_t at = 0; at < frame_.size();) {
    // The host's processes ignore SIGPIPE: a process that is gone is an error here.
    const ssize_t n = ::write(requests_, frame_.data() + at, frame_.size() - at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) FailAsItEnded("it was asked");
    at += static_cast<std::size_t>(n);
  }
  std::uint32_t size = 0;
  LookFor(answers_);
  Read(reinterpret_cast<char*>(&size), sizeof size);
  if (size == 0 || size > kLongestFrame) {
    throw ProcessError(interpreter_ + " answered with a frame of " + std::to_string(size) +
                       " bytes");
  }
  frame_.resize(size);
  Read(frame_.data(), size);
  const std::string_view answer(frame_.data() + 1, size - 1);
  if (frame_[0] == 'e') throw EnvironmentError(std::string(answer));
  if (frame_[0] != std::tolower(kind)) {
    throw ProcessError(interpreter_ + " gave an answer of another kind");
  }
  return answer;
}

}  // namespace dreamsearch::gym
