#include "host/processes/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <sstream>

#include "host/processes/stop_signals.h"
#include "results/system/child.h"
#include "results/system/machine_fault.h"

namespace dreamsearch {

FileDescriptor MemoryFile(const std::string& text) {
  FileDescriptor file(::memfd_create("dreamsearch", MFD_CLOEXEC));
  if (file.get() < 0) throw SystemFailure("make a memory file", errno);
  if (!WriteAll(file.get(), text)) throw SystemFailure("write a memory file", errno);
  ::lseek(file.get(), 0, SEEK_SET);
  return file;
}

pid_t StartChild(const ChildSpec& spec) {
  std::vector<std::string> arguments = {"runner"};
  arguments.insert(arguments.end(), spec.arguments.begin(), spec.arguments.end());
  std::vector<char*> argv = ArgumentVector(&arguments);

  // Duplicates above 4 first, so that no dup2 overwrites a source.
  const auto lifted = [](int fd) {
    return FileDescriptor(fd < 0 ? ::open("/dev/null", O_RDWR | O_CLOEXEC)
                                 : ::fcntl(fd, F_DUPFD_CLOEXEC, 10));
  };
  const FileDescriptor input = lifted(spec.input);
  const FileDescriptor log = lifted(spec.log);
  const FileDescriptor report = lifted(spec.report);
  const FileDescriptor threads = spec.threads < 0 ? FileDescriptor() : lifted(spec.threads);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input.get(), 0);
  posix_spawn_file_actions_adddup2(&actions, log.get(), 1);
  posix_spawn_file_actions_adddup2(&actions, log.get(), 2);
  posix_spawn_file_actions_adddup2(&actions, report.get(), kReportDescriptor);
  if (threads.get() >= 0) {
    posix_spawn_file_actions_adddup2(&actions, threads.get(), kThreadsDescriptor);
  }

  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, defaults;
  sigemptyset(&none);
  sigemptyset(&defaults);
  for (const int signal : kStopSignals) {
    if (!IsIgnored(signal)) sigaddset(&defaults, signal);
  }
  sigaddset(&defaults, StopRequestSignal());
  sigaddset(&defaults, SIGPIPE);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  pid_t pid = -1;
  const int error =
      ::posix_spawn(&pid, "/proc/self/exe", &actions, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) throw SystemFailure("start a worker process", error);
  return pid;
}

bool ParentIsGone() {
  pollfd report = {kReportDescriptor, 0, 0};
  return ::poll(&report, 1, 0) == 1 && (report.revents & (POLLERR | POLLNVAL)) != 0;
}

void EndWithParent(int signal) {
  ::prctl(PR_SET_PDEATHSIG, signal);
  if (ParentIsGone()) ::raise(signal);  // it went before the line above
}

namespace {

// The fields of /proc/PID/stat from the third on: the state first. Empty if the process is gone.
std::string StatusFields(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::size_t after_name = text.rfind(')');
  return after_name == std::string::npos ? "" : text.substr(after_name + 2);
}

}  // namespace

double ProcessorSeconds(pid_t pid) {
  const std::string text = StatusFields(pid);
  if (text.empty()) return -1;
  std::istringstream fields(text);
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0, system = 0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

bool IsAsleep(pid_t pid) { return StatusFields(pid).starts_with('S'); }

std::string DescribeWaitStatus(int status) {
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    return "signal " + std::to_string(signal) + " (" + ::strsignal(signal) + ")";
  }
  return "exit status " + std::to_string(WEXITSTATUS(status));
}

}  // namespace dreamsearch
