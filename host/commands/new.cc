// runner new planner|model|environment NAME - how does one begin a plugin of one's own?
//
// The templates are the SDK's examples (sdk/examples), copied under another name: what is compiled
// and checked as an example is what people begin with.
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "host/commands/commands.h"
#include "host/commands/own_folder.h"
#include "results/command_line/values.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/names.h"
#include "results/text/shell.h"

namespace dreamsearch {
namespace {

// The example of a kind: the name in its files that becomes the new one.
struct Example {
  std::string kind;
  std::string name;
};

// "pushed_ball" as a class is called: "PushedBall".
std::string CamelCase(const std::string& name) {
  std::string camel;
  bool upper = true;
  for (const char c : name) {
    if (c == '_') {
      upper = true;
      continue;
    }
    camel += upper ? static_cast<char>(std::toupper(c)) : c;
    upper = false;
  }
  return camel;
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

// A component's name that is a target of CMake and a class of C++ as well.
void CheckName(const std::string& name) {
  const bool fits = !name.empty() && name[0] >= 'a' && name[0] <= 'z' &&
                    std::all_of(name.begin(), name.end(), [](char c) {
                      return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
                    });
  if (!fits) {
    throw Failure(ExitCode::kUsage,
                  "runner new: expected a name of small letters, digits and _ that begins with a "
                  "letter, found " +
                      ShellWord(name));
  }
  // Targets that CMake has itself, and classes that the SDK has.
  static const std::vector<std::string> kTaken = {
      "all",           "clean",          "edit_cache", "environment", "error",      "help",
      "install",       "model",          "package",    "planner",     "preinstall", "random",
      "rebuild_cache", "package_source", "settings",   "status",      "test",       "view",
      "weights",       "bytes",          "state"};
  if (std::find(kTaken.begin(), kTaken.end(), name) == kTaken.end()) return;
  throw Failure(ExitCode::kUsage,
                "runner new: the name '" + name +
                    "' is taken, by CMake or the SDK. Choose another, such as my_" + name);
}

struct New {
  std::string kind;
  std::string name;
  std::string out;

  CommandSpec Declare() {
    return {
        .name = "runner new",
        .summary = "writes a plugin project to begin with: source, build, test, README",
        .examples = {"runner new planner my_planner", "runner new environment rope --out src/rope"},
        .about =
            "The project builds against the installed SDK (CMake and a C++20 compiler) and "
            "passes `runner check` as it is written. sdk/README.md goes on from there.",
        .arguments = {{"", "KIND", OneOf(&kind, {"planner", "model", "environment"}).Required(),
                       "what to write"},
                      {"", "NAME", Text(&name).Required(),
                       "the component's name: small letters, digits and _"}},
        .groups = {{"Where",
                    {{"out", "FOLDER", Text(&out).Default("NAME"),
                      "the project's folder; it must be empty or not there"}}}}};
  }
  int Run();
};

int New::Run() {
  CheckName(name);
  const Example examples[] = {
      {"planner", "best_of_samples"}, {"model", "linear_model"}, {"environment", "pushed_ball"}};
  const Example& example = *std::find_if(std::begin(examples), std::end(examples),
                                         [&](const Example& one) { return one.kind == kind; });
  const std::filesystem::path source = OwnFolder() / "examples" / kind;
  std::error_code error;
  if (!std::filesystem::is_directory(source, error)) {
    throw Failure(ExitCode::kNotFound, "runner new: expected the example " + source.string() +
                                           ", which belongs to an installation, found none");
  }
  const std::filesystem::path folder =
      std::filesystem::absolute(out.empty() ? name : out).lexically_normal();
  if (std::filesystem::exists(folder, error) && (!std::filesystem::is_directory(folder, error) ||
                                                 !std::filesystem::is_empty(folder, error))) {
    throw Failure(ExitCode::kCannotCreate,
                  "runner new: expected " + folder.string() +
                      " to be an empty folder or not there, found something in it. Choose another "
                      "with --out");
  }
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw Failure(ExitCode::kCannotCreate,
                  "runner new: cannot create " + folder.string() + ": " + error.message());
  }
  std::vector<std::string> written;
  for (const auto& entry : std::filesystem::directory_iterator(source)) {
    const std::string file = Replaced(entry.path().filename().string(), example.name, name);
    std::string text = ReadWholeFile(entry.path());
    text = Replaced(std::move(text), example.name, name);
    text = Replaced(std::move(text), CamelCase(example.name), CamelCase(name));
    WriteWholeFile(folder / file, text);
    written.push_back(file);
  }
  std::sort(written.begin(), written.end());
  std::cout << "wrote " << folder.string() << ": " << JoinNames(written) << "\n\n"
            << "  cd " << ShellWord(folder.string()) << "\n"
            << "  cmake -S . -B build && cmake --build build\n"
            << "  runner check build/" << name << ".so\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command NewCommand() { return MakeCommand<New>(); }

}  // namespace dreamsearch
