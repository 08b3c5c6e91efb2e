#include "host/processes/child_request.h"

#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iostream>
#include <new>
#include <nlohmann/json.hpp>

#include "host/acting/activity_clock.h"
#include "host/processes/child_process.h"
#include "host/settings/memory.h"
#include "results/system/child.h"
#include "results/system/error.h"
#include "results/system/file_descriptor.h"
#include "results/text/json_text.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// How often the child's memory is looked at.
constexpr double kMemorySeconds = 0.05;
constexpr double kUnannouncedSeconds = 10;

}  // namespace

nlohmann::json AskChild(const ChildRequest& request, const nlohmann::json& content) {
  Pipe pipe = MakePipe();
  const FileDescriptor input = MemoryFile(results::JsonText(content));
  ChildSpec child;
  child.arguments = {request.command};
  child.input = input.get();
  child.log = request.show_messages ? STDERR_FILENO : -1;
  child.report = pipe.write.get();
  const pid_t pid = StartChild(child);
  pipe.write.Close();

  std::string text;
  const double deadline = ActivityClock::Now() + request.timeout_seconds;
  bool timed_out = false, said = false;
  for (;;) {
    // A constructor without end would otherwise be silent until the timeout.
    if (!said && request.timeout_seconds > 0 &&
        deadline - ActivityClock::Now() < request.timeout_seconds - kUnannouncedSeconds) {
      said = true;
      std::cerr << "waiting for the components of " << request.who << ", for at most "
                << FormatDuration(request.timeout_seconds) << std::endl;
    }
    if (request.memory_limit_bytes > 0 && ResidentBytes(pid) > request.memory_limit_bytes) {
      ::kill(pid, SIGKILL);
      WaitForEnd(pid);
      throw Failure(ExitCode::kPluginCrashed,
                    "the components of " + request.who + " took more than " +
                        FormatBytes(static_cast<double>(request.memory_limit_bytes)) +
                        " of memory, which is what one run may take (--memory-limit, or its share "
                        "of what is free)");
    }
    pollfd polled{pipe.read.get(), POLLIN, 0};
    double left = request.timeout_seconds > 0 ? deadline - ActivityClock::Now() : 1;
    if (left <= 0) {
      timed_out = true;
      ::kill(pid, SIGKILL);
      break;
    }
    if (request.memory_limit_bytes > 0) left = std::min(left, kMemorySeconds);
    if (!said) left = std::min(left, 1.0);
    if (::poll(&polled, 1, std::max(1, static_cast<int>(left * 1000))) <= 0) continue;
    char buffer[65536];
    const ssize_t got = ::read(pipe.read.get(), buffer, sizeof buffer);
    if (got > 0) {
      text.append(buffer, static_cast<std::size_t>(got));
    } else if (got == 0 || (errno != EAGAIN && errno != EINTR)) {
      break;
    }
  }
  const int status = WaitForEnd(pid);
  if (timed_out) {
    throw Failure(ExitCode::kPluginCrashed,
                  "the components of " + request.who + " did not answer within " +
                      std::to_string(static_cast<int>(request.timeout_seconds)) + " s");
  }
  nlohmann::json answer = results::ParseJsonOrDiscard(text);
  if (answer.is_object() && answer.contains("error")) {
    throw Failure(static_cast<ExitCode>(WIFEXITED(status) ? WEXITSTATUS(status) : 70),
                  answer["error"].get<std::string>());
  }
  if (!answer.is_object() || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw Failure(ExitCode::kPluginCrashed, "`runner " + request.command +
                                                "` with the components of " + request.who +
                                                " ended with " + DescribeWaitStatus(status));
  }
  return answer;
}

int AnswerMain(const std::function<nlohmann::json(const nlohmann::json&)>& answer) {
  EndWithParent(SIGKILL);
  ::signal(SIGPIPE, SIG_IGN);
  nlohmann::json text;
  int status = 0;
  const auto fail = [&](const std::string& message, int code) {
    text = {{"error", message}};
    status = code;
  };
  try {
    text = answer(results::ParseJson(ReadAll(0)));
  } catch (const Failure& error) {
    fail(error.what(), error.exit_status());
  } catch (const nlohmann::json::exception& error) {
    fail(std::string("this command is started by `runner` itself: ") + error.what(),
         static_cast<int>(ExitCode::kInternal));
  } catch (const std::bad_alloc&) {
    fail("out of memory", static_cast<int>(ExitCode::kInternal));
  }
  WriteAll(kReportDescriptor, results::JsonTextReplacing(text) + "\n");
  return status;
}

}  // namespace dreamsearch
