// runner - trains, evaluates and inspects look-ahead agents. See --help.
#include <signal.h>

#include <exception>
#include <functional>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "host/commands/commands.h"
#include "host/plugins/catalogue.h"
#include "host/processes/probe.h"
#include "host/processes/worker.h"
#include "host/training/provenance.h"
#include "results/system/error.h"
#include "results/system/names.h"

namespace dreamsearch {
namespace {

using Command = std::function<int(const std::vector<std::string>&)>;

// A command of the design that this version does not have yet.
Command NotYet(const char* name) {
  return [name](const std::vector<std::string>&) -> int {
    throw Failure(ExitCode::kInternal,
                  std::string("`runner ") + name + "` is not part of this version yet");
  };
}

const std::map<std::string, Command>& Commands() {
  static const std::map<std::string, Command> commands = {
      {"check", NotYet("check")},  {"describe", DescribeCommand}, {"eval", EvalCommand},
      {"explain", ExplainCommand}, {"export", ExportCommand},     {"list", ListCommand},
      {"new", NotYet("new")},      {"render", NotYet("render")},  {"resume", ResumeCommand},
      {"status", StatusCommand},   {"verify", VerifyCommand},
  };
  return commands;
}

int Dispatch(std::vector<std::string> arguments) {
  if (arguments.empty() || arguments[0].rfind("-", 0) == 0) return RunCommand(arguments);
  const std::string name = arguments[0];
  arguments.erase(arguments.begin());
  // Processes that `runner` starts itself.
  if (name == "worker") return WorkerMain();
  if (name == "probe") return ProbeMain();
  if (name == "export-model") return ExportModelMain();
  if (name == "explain-decision") return ExplainDecisionMain();
  if (name == "describe-plugin" && arguments.size() == 1) return DescribePluginMain(arguments[0]);
  const auto found = Commands().find(name);
  if (found == Commands().end()) {
    std::vector<std::string> known;
    for (const auto& [command, function] : Commands()) known.push_back(command);
    throw Failure(ExitCode::kUsage, "no subcommand '" + name + "'. " + KnownNames(name, known));
  }
  return found->second(arguments);
}

}  // namespace
}  // namespace dreamsearch

int main(int argc, char** argv) {
  // Whoever reads along may leave, as in `runner ... 2>&1 | head`: no sweep ends for it.
  ::signal(SIGPIPE, SIG_IGN);
  int status = 0;
  try {
    dreamsearch::CheckInstructionSet();
    status = dreamsearch::Dispatch({argv + 1, argv + argc});
  } catch (const dreamsearch::Failure& error) {
    std::cerr << "error: " << error.what() << std::endl;
    return error.exit_status();
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << " (a defect of runner)" << std::endl;
    return static_cast<int>(dreamsearch::ExitCode::kInternal);
  }
  std::cout.flush();
  if (!std::cout) return static_cast<int>(dreamsearch::ExitCode::kInputOutput);
  return status;
}
