// runner - trains, evaluates and inspects look-ahead agents. See --help.
#include <signal.h>

#include <string>

#include "dreamsearch/version.h"
#include "host/commands/commands.h"
#include "host/films/filmed_episode.h"
#include "host/plugins/catalogue.h"
#include "host/processes/worker.h"
#include "host/sweeps/probe.h"
#include "host/training/build_and_host.h"
#include "results/command_line/program.h"
#include "results/system/error.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

int DescribePlugin(const Words& words) {
  if (words.size() == 1) return DescribePluginMain(words[0]);
  throw Failure(ExitCode::kUsage, "runner describe-plugin: expected the path of a plugin");
}

// Words are recorded with the runs and handed to workers as JSON, which holds UTF-8 only.
Words CheckedWords(Words words) {
  for (const std::string& word : words) {
    if (IsUtf8(word)) continue;
    throw Failure(ExitCode::kUsage, "runner: expected text in UTF-8, found other bytes in " +
                                        ShellWord(word) + ". Rename the file or folder");
  }
  return words;
}

Program Runner() {
  const auto own = [](int (*process)()) { return [process](const Words&) { return process(); }; };
  return {.version = "dreamsearch " DREAMSEARCH_VERSION ", plugin SDK " +
                     std::to_string(DREAMSEARCH_SDK_MAJOR) + "." +
                     std::to_string(DREAMSEARCH_SDK_MINOR),
          .root = RunCommand(),
          .commands = {ListCommand(), DescribeCommand(), CheckCommand(), NewCommand(),
                       StatusCommand(), ResumeCommand(), EvalCommand(), ExtendCommand(),
                       VerifyCommand(), ExportCommand(), ExplainCommand(), RenderCommand(),
                       SubmitCommand(), WatchCommand()},
          .internal = {{"worker", own(WorkerMain)},
                       {"probe", own(ProbeMain)},
                       {"export-model", own(ExportModelMain)},
                       {"explain-decision", own(ExplainDecisionMain)},
                       {"film-episode", own(FilmEpisodeMain)},
                       {"check-component", own(CheckComponentMain)},
                       {"describe-plugin", DescribePlugin}}};
}

}  // namespace
}  // namespace dreamsearch

int main(int argc, char** argv) {
  // Whoever reads along may leave, as in `runner ... 2>&1 | head`: no sweep ends for it.
  ::signal(SIGPIPE, SIG_IGN);
  return dreamsearch::ExitStatusOf("runner", [&] {
    dreamsearch::CheckInstructionSet();
    return dreamsearch::RunProgram(dreamsearch::Runner(),
                                   dreamsearch::CheckedWords({argv + (argc > 0), argv + argc}));
  });
}
