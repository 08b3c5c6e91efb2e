#include "host/plugins/describing.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "host/plugins/plugin_loader.h"
#include "results/system/child.h"
#include "results/system/file.h"
#include "results/system/file_descriptor.h"
#include "results/system/machine_fault.h"
#include "results/system/sha256.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"

namespace dreamsearch {
namespace {

using Clock = std::chrono::steady_clock;

// What a child writes last; without it the description may be cut short.
constexpr std::string_view kDoneToken = "\ndone\n";

// --- the parent's side -------------------------------------------------------

// Starts the describing program on one file. Whatever the library prints does
// not reach our output, and one that reads finds the end of its input.
pid_t Spawn(const std::string& file, const ScanOptions& options, int description, int errors) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, description, kDescribeDescriptor);

  // A group of its own, so that what the library starts ends with it; default
  // signals, whatever the host blocks or ignores.
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t none, all;
  ::sigemptyset(&none);
  ::sigfillset(&all);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setsigdefault(&attributes, &all);
  ::posix_spawnattr_setflags(
      &attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);

  std::vector<std::string> words = {options.program};
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  words.push_back(file);
  std::vector<char*> argv = ArgumentVector(&words);

  pid_t child = 0;
  const int failure =
      ::posix_spawn(&child, options.program.c_str(), &actions, &attributes, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  if (failure != 0) throw SystemFailure("start " + options.program, failure);
  return child;
}

// Appends what there is to *text and keeps its last `most` bytes. Returns false
// at the end of the stream.
bool ReadAvailable(const FileDescriptor& descriptor, std::size_t most, std::string* text) {
  char block[65536];
  for (;;) {
    const ssize_t got = ::read(descriptor.get(), block, sizeof block);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return errno == EAGAIN;
    if (got == 0) return false;
    text->append(block, static_cast<std::size_t>(got));
    if (text->size() > most) text->erase(0, text->size() - most);
    // One block a call: a library that never stops printing must not keep us
    // from looking at the clock.
    return true;
  }
}

struct ChildResult {
  std::string description;  // without the token
  bool done = false;        // the token came
  bool timed_out = false;
  int wait_status = 0;
  std::string errors;  // the end of what it wrote to standard error
};

// Runs the describing program on one file until it has written its token, has
// ended, or the time is over. The child is gone when this returns.
ChildResult RunChild(const std::string& file, const ScanOptions& options) {
  constexpr std::size_t kMostDescription = 64 << 20, kMostErrors = 4096;
  constexpr int kPollMilliseconds = 20;
  Pipe description = MakePipe();
  Pipe errors = MakePipe();
  const Clock::time_point deadline = Clock::now() + options.timeout;
  const pid_t child = Spawn(file, options, description.write.get(), errors.write.get());
  description.write.Close();
  errors.write.Close();

  ChildResult result;
  bool description_open = true, errors_open = true;
  for (;;) {
    // Ended, but not yet reaped: its process group cannot be another's by now.
    siginfo_t info = {};
    const bool ended =
        ::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOWAIT | WNOHANG) == 0 &&
        info.si_pid == child;
    if (description_open) {
      description_open = ReadAvailable(description.read, kMostDescription, &result.description);
      result.done = result.description.ends_with(kDoneToken);
    }
    if (errors_open) errors_open = ReadAvailable(errors.read, kMostErrors, &result.errors);
    if (ended && result.done) break;
    if (ended) {
      // All it wrote is in the pipe; a grandchild may hold the other end open.
      pollfd ready = {description.read.get(), POLLIN, 0};
      if (!description_open || ::poll(&ready, 1, 0) == 0 || Clock::now() >= deadline) break;
      continue;
    }
    if (Clock::now() >= deadline) {
      result.timed_out = !result.done;
      break;
    }
    pollfd ready[2] = {{description_open ? description.read.get() : -1, POLLIN, 0},
                       {errors_open ? errors.read.get() : -1, POLLIN, 0}};
    ::poll(ready, 2, kPollMilliseconds);
  }
  ::kill(-child, SIGKILL);
  result.wait_status = WaitForEnd(child);
  if (errors_open) ReadAvailable(errors.read, kMostErrors, &result.errors);
  if (result.done) result.description.resize(result.description.size() - kDoneToken.size());
  return result;
}

// The last line of a text, printable and short; empty if there is none.
std::string LastLine(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  std::string line = text.substr(text.find_last_of("\r\n") + 1);  // npos + 1 is 0
  line.erase(0, std::min(line.find_first_not_of(" \t"), line.size()));
  constexpr std::size_t kMost = 200;
  if (line.size() > kMost) line = line.substr(0, kMost) + "...";
  for (char& c : line) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  return line;
}

}  // namespace

const PluginDescription* KnownPlugins::Find(const std::string& file,
                                            const std::string& sha256) const {
  const auto found =
      std::find_if(plugins.begin(), plugins.end(), [&](const PluginDescription& plugin) {
        return !plugin.components.empty() && plugin.components.front().plugin.path == file &&
               plugin.components.front().plugin.sha256 == sha256;
      });
  return found == plugins.end() || sha256.empty() ? nullptr : &*found;
}

KnownPlugins ReadKnownPlugins() {
  const char* file = std::getenv(kKnownPluginsVariable);
  if (file == nullptr) return {};
  try {
    return results::FieldsFromJson<KnownPlugins>(results::ParseJson(ReadWholeFile(file)));
  } catch (const std::exception&) {
    return {};
  }
}

PluginDescription DescribeInChild(const std::string& file, const ScanOptions& options) {
  PluginDescription description;
  const auto refuse = [&](ExitCode code, const std::string& message) {
    description.refused = true;
    description.refusal = {file, code, message};
    return description;
  };
  std::string sha256;
  ChildResult child;
  try {
    // A folder or a named pipe called x.so has no digest; the child says what it is.
    if (std::filesystem::is_regular_file(file)) sha256 = Sha256HexOfFile(file);
    if (const PluginDescription* known = options.known.Find(file, sha256)) return *known;
    child = RunChild(file, options);
  } catch (const Failure& error) {
    return refuse(error.code(), error.what());
  }
  const std::string where = "plugin " + file + ": ";
  const std::string last = LastLine(child.errors);
  const std::string said = last.empty() ? "" : "; its last words: " + last;
  if (child.timed_out) {
    return refuse(ExitCode::kPluginCrashed,
                  where + "expected to load in " +
                      std::to_string(options.timeout.count() / 1000.0).substr(0, 4) +
                      " s, found it still loading; it was ended" + said);
  }
  if (!child.done && WIFSIGNALED(child.wait_status)) {
    const int signal = WTERMSIG(child.wait_status);
    return refuse(ExitCode::kPluginCrashed,
                  where + "crashed while it was loaded: " + ::strsignal(signal) + " (signal " +
                      std::to_string(signal) + ")" + said);
  }
  if (!child.done) {
    return refuse(ExitCode::kPluginCrashed,
                  where + "ended the process while it was loaded (exit status " +
                      std::to_string(WEXITSTATUS(child.wait_status)) + ")" + said);
  }
  try {
    description = results::FieldsFromJson<PluginDescription>(results::ParseJson(child.description));
  } catch (const nlohmann::json::exception& error) {
    return refuse(ExitCode::kPluginCrashed,
                  where + "its description cannot be read: " + error.what() + said);
  }
  description.refusal.path = file;
  for (ComponentInfo& component : description.components) {
    component.plugin.path = file;
    component.plugin.sha256 = sha256;
  }
  return description;
}

// --- the child's side --------------------------------------------------------

namespace {

// Bytes of data that the process has mapped, a sanitizer's shadow included.
rlim_t DataBytes() {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("VmData:")) return std::strtoull(line.c_str() + 7, nullptr, 10) << 10;
  }
  return 0;
}

// A library that allocates without end meets a limit instead of the machine's. It counts from
// what is mapped already: a preloaded sanitizer has reserved terabytes.
void LimitResources() {
  const rlimit none = {0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
  constexpr rlim_t kMostData = rlim_t{1} << 30;
  const rlim_t most = DataBytes() + kMostData;
  const rlimit data = {most, most};
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  ::setrlimit(RLIMIT_DATA, &data);
#else
  static_cast<void>(data);
#endif
}

PluginDescription Describe(const std::string& file) {
  PluginDescription description;
  const auto refuse = [&](ExitCode code, const std::string& message) {
    description = {true, {file, code, message}, {}};
  };
  try {
    const PluginDescriptor& plugin = LoadPlugin(file);
    const PluginInfo info = {plugin.name, plugin.version,   file,
                             "",          plugin.sdk_major, plugin.sdk_minor};
    for (const ComponentDescriptor& component : plugin.components) {
      description.components.push_back(DescribeComponent(component, info));
    }
  } catch (const Failure& error) {
    refuse(error.code(), error.what());
  } catch (const std::exception& error) {
    refuse(ExitCode::kInternal, "plugin " + file + ": " + error.what());
  }
  return description;
}

}  // namespace

int DescribePluginMain(const std::string& file) {
  if (::fcntl(kDescribeDescriptor, F_SETFD, FD_CLOEXEC) != 0) {
    std::fprintf(stderr,
                 "runner: describe-plugin is for the runner's own use; "
                 "see runner list\n");
    return static_cast<int>(ExitCode::kUsage);
  }
  // Should the parent be killed, a library that hangs ends with it.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  pollfd answer = {kDescribeDescriptor, 0, 0};
  if (::poll(&answer, 1, 0) == 1) ::_exit(0);  // it was, before the line above
  LimitResources();
  std::string text = results::JsonTextReplacing(results::FieldsToJson(Describe(file)));
  text += kDoneToken;
  const bool written = WriteAll(kDescribeDescriptor, text);
  // Without exit handlers: the library's own might crash.
  ::_exit(written ? 0 : static_cast<int>(ExitCode::kInputOutput));
}

}  // namespace dreamsearch
