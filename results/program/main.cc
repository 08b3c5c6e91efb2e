// results - reads, compares, draws, merges and checks results databases.
#include <exception>
#include <iostream>
#include <new>

#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/names.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

struct Command {
  const char* name;
  const char* summary;
  int (*run)(const Words&);
};

constexpr Command kCommands[] = {
    {"list", "runs, one line each", ListCommand},
    {"show", "all there is to know about one run", ShowCommand},
    {"curves", "learning curves as a picture (SVG, PNG, PDF) or table", CurvesCommand},
    {"compare", "statistics over tasks and seeds, with intervals", CompareCommand},
    {"report", "one HTML page with every figure and table", ReportCommand},
    {"export", "CSV, JSON lines and the formats of published scores", ExportCommand},
    {"import", "published scores, to be drawn beside ours", ImportCommand},
    {"merge", "runs of several databases into one", MergeCommand},
    {"verify", "checks every stored row against its digest", VerifyCommand},
    {"delete", "deletes runs and all they recorded", DeleteCommand},
    {"sql", "runs a query and prints a table", SqlCommand},
};

void PrintHelp() {
  std::cout << "results - reads the results database that `runner` writes\n\n"
               "usage: results COMMAND [options]      results COMMAND --help\n\n";
  for (const Command& command : kCommands) {
    std::cout << "  " << command.name << std::string(10 - std::string(command.name).size(), ' ')
              << command.summary << "\n";
  }
  std::cout << "\nAll take --db FILE (default: results/dreamsearch.db).\n";
}

int Dispatch(const Words& words) {
  if (words.empty() || words[0] == "--help" || words[0] == "-h" || words[0] == "help") {
    PrintHelp();
    return static_cast<int>(words.empty() ? ExitCode::kUsage : ExitCode::kOk);
  }
  if (words[0] == "--version") {
    std::cout << "results " << DREAMSEARCH_PROJECT_VERSION << "\n";
    return static_cast<int>(ExitCode::kOk);
  }
  std::vector<std::string> known;
  for (const Command& command : kCommands) {
    if (words[0] == command.name) return command.run({words.begin() + 1, words.end()});
    known.emplace_back(command.name);
  }
  throw Failure(ExitCode::kUsage,
                "no command '" + Printable(words[0]) + "'. " + KnownNames(words[0], known));
}

}  // namespace
}  // namespace dreamsearch::results

int main(int argc, char** argv) {
  using dreamsearch::Failure;
  try {
    const int code = dreamsearch::results::Dispatch({argv + std::min(argc, 1), argv + argc});
    std::cout.flush();
    if (!std::cout) {
      std::cerr << "results: standard output could not be written\n";
      return static_cast<int>(dreamsearch::ExitCode::kInputOutput);
    }
    return code;
  } catch (const Failure& error) {
    std::cerr << "results: " << error.what() << "\n";
    return error.exit_status();
  } catch (const std::exception& error) {
    std::cerr << "results: internal error: " << error.what() << "\n";
    return static_cast<int>(dreamsearch::ExitCode::kInternal);
  }
}
