#include "results/command_line/program.h"

#include <unistd.h>

#include <exception>
#include <filesystem>
#include <iostream>
#include <new>
#include <system_error>
#include <utility>

#include "results/command_line/help.h"
#include "results/command_line/man_page.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/file_descriptor.h"
#include "results/text/names.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

HelpPart ExitStatusPart() {
  const std::pair<ExitCode, const char*> meanings[] = {
      {ExitCode::kOk, "everything was done"},
      {ExitCode::kUsage, "the command line is wrong"},
      {ExitCode::kBadInput, "a configuration file, a database or another input is wrong"},
      {ExitCode::kNotFound, "a file, run, component or plugin was not found"},
      {ExitCode::kPluginRefused, "a plugin was found and cannot be used"},
      {ExitCode::kInternal, "a defect of this program"},
      {ExitCode::kPluginCrashed, "a plugin crashed or took too long"},
      {ExitCode::kDiverged, "a run diverged"},
      {ExitCode::kCannotCreate, "an output cannot be created"},
      {ExitCode::kInputOutput,
       "reading or writing failed, the disk is full or a database locked; the same command "
       "resumes"},
      {ExitCode::kInterrupted, "stopped; the same command resumes"},
      {ExitCode::kPermission, "no permission"},
      {ExitCode::kVerificationFailed, "stored and recomputed results differ"}};
  HelpPart part = {"Exit status"};
  for (const auto& [code, meaning] : meanings) {
    part.rows.emplace_back(std::to_string(static_cast<int>(code)), meaning);
  }
  return part;
}

// Whether one of the words asks for it; what follows `--` asks for nothing.
bool Asks(const Words& words, const std::string& flag) {
  for (const std::string& word : words) {
    if (word == "--") return false;
    if (word == flag) return true;
  }
  return false;
}

int RunCommand(const Program& program, const Command& command, const std::string& help,
               const Words& words) {
  if (Asks(words, "--help") || Asks(words, "-h")) {
    std::cout << help;
    return static_cast<int>(ExitCode::kOk);
  }
  if (Asks(words, "--version")) {
    std::cout << program.version << "\n";
    return static_cast<int>(ExitCode::kOk);
  }
  return command.Call(words);
}

}  // namespace

std::vector<HelpPart> ProgramHelpParts(const Program& program) {
  std::vector<HelpPart> parts = HelpParts(program.root.spec);
  HelpPart commands = {"Commands"};
  for (const Command& command : program.commands) {
    commands.rows.emplace_back(command.name(), command.spec.summary);
  }
  commands.rows.emplace_back("COMMAND --help", "says more about a command");
  parts.push_back(commands);
  parts.push_back(ExitStatusPart());
  return parts;
}

std::string ProgramHelp(const Program& program) {
  return HelpText(program.root.spec, ProgramHelpParts(program));
}

int RunProgram(const Program& program, const Words& words) {
  if (words.empty() && !program.root.run) {
    std::cout << ProgramHelp(program);
    return static_cast<int>(ExitCode::kUsage);
  }
  if (words.empty() || words[0].starts_with("-")) {
    return RunCommand(program, program.root, ProgramHelp(program), words);
  }
  const Words rest(words.begin() + 1, words.end());
  if (const auto own = program.internal.find(words[0]); own != program.internal.end()) {
    return own->second(rest);
  }
  if (words[0] == "man-pages" && rest.size() == 1) {
    WriteManPages(program, rest[0]);
    return static_cast<int>(ExitCode::kOk);
  }
  if (words[0] == "help") {
    std::cout << ProgramHelp(program);
    return static_cast<int>(ExitCode::kOk);
  }
  std::vector<std::string> known;
  for (const Command& command : program.commands) {
    if (words[0] == command.name()) {
      return RunCommand(program, command, HelpText(command.spec), rest);
    }
    known.push_back(command.name());
  }
  throw Failure(ExitCode::kUsage, program.root.spec.name + ": no command '" + Printable(words[0]) +
                                      "'. " + KnownNames(words[0], known));
}

// What the file system says to a path that the user gave is no defect of ours.
static ExitCode CodeOf(const std::error_code& error) {
  if (error == std::errc::permission_denied || error == std::errc::operation_not_permitted ||
      error == std::errc::read_only_file_system) {
    return ExitCode::kPermission;
  }
  if (error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory) {
    return ExitCode::kNotFound;
  }
  if (error == std::errc::too_many_symbolic_link_levels || error == std::errc::filename_too_long ||
      error == std::errc::is_a_directory || error == std::errc::file_exists) {
    return ExitCode::kCannotCreate;
  }
  return ExitCode::kInputOutput;
}

int ExitStatusOf(const std::string& program, const std::function<int()>& work) {
  try {
    const int status = work();
    std::cout.flush();
    if (std::cout || ReaderLeft(STDOUT_FILENO)) return status;
    std::cerr << "error: standard output could not be written" << std::endl;
    return static_cast<int>(ExitCode::kInputOutput);
  } catch (const Failure& error) {
    std::cerr << "error: " << PrintableLines(error.what()) << std::endl;
    return error.exit_status();
  } catch (const std::filesystem::filesystem_error& error) {
    std::cerr << "error: " << PrintableLines(AbsolutePath(error.path1().string())) << ": "
              << error.code().message() << std::endl;
    return static_cast<int>(CodeOf(error.code()));
  } catch (const std::bad_alloc&) {
    std::cerr << "error: out of memory" << std::endl;
    return static_cast<int>(ExitCode::kInputOutput);
  } catch (const std::exception& error) {
    std::cerr << "error: " << PrintableLines(error.what()) << " (a defect of " << program << ")"
              << std::endl;
    return static_cast<int>(ExitCode::kInternal);
  }
}

}  // namespace dreamsearch
