#include "host/sweeps/recorded_code.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "host/plugins/catalogue.h"
#include "host/settings/run_parameters.h"
#include "results/system/error.h"
#include "results/system/sha256.h"
#include "results/text/names.h"
#include "results/text/shell.h"

namespace dreamsearch {
namespace {

namespace fs = std::filesystem;

bool IsUnder(const fs::path& file, const fs::path& folder) {
  std::error_code error;
  const fs::path real = fs::weakly_canonical(file, error),
                 top = fs::weakly_canonical(folder, error);
  return !error &&
         std::mismatch(top.begin(), top.end(), real.begin(), real.end()).first == top.end();
}

// Of the folders, the file with this name and digest, or else one of this name; empty if there is
// none.
fs::path InFolders(const std::vector<fs::path>& folders, const std::string& name,
                   const std::string& sha256) {
  fs::path other;
  for (const fs::path& folder : folders) {
    std::error_code error;
    const fs::path file = folder / name;
    if (!fs::is_regular_file(file, error)) continue;
    if (Sha256HexOfFile(file) == sha256) return file;
    if (other.empty()) other = file;
  }
  return other;
}

// A text that is the path of a program, or of a module that a program loads.
bool IsProgram(const ResolvedValue& value) {
  if (!IsText(value.type) || value.choice.find('/') == std::string::npos) return false;
  std::error_code error;
  const fs::path file = value.choice;
  if (file.extension() == ".py" || file.extension() == ".so") return true;
  return fs::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0;
}

}  // namespace

void TrustRecordedCode(const std::vector<std::string>& plugin_path, const std::string& who,
                       RunSpec* spec) {
  const std::vector<fs::path> folders = PluginFolders(plugin_path);
  std::vector<ResolvedComponent*> components = {&spec->environment, &spec->model, &spec->planner,
                                                &spec->eval_planner};
  if (spec->evaluation && spec->evaluation->trained_model) {
    components.push_back(&*spec->evaluation->trained_model);
  }
  // What is not trusted, in words, and the flags that would change that.
  std::vector<std::string> named, flags;
  const auto distrust = [&](const std::string& what, const fs::path& file) {
    const std::string flag = "--plugin-path " + ShellWord(file.parent_path().string());
    if (std::find(flags.begin(), flags.end(), flag) == flags.end()) flags.push_back(flag);
    const std::string text = what + file.string();
    if (std::find(named.begin(), named.end(), text) == named.end()) named.push_back(text);
  };
  for (ResolvedComponent* component : components) {
    ComponentInfo info = *component->info;
    const fs::path recorded = info.plugin.path;
    const fs::path trusted = InFolders(folders, recorded.filename().string(), info.plugin.sha256);
    if (!trusted.empty()) {
      info.plugin.path = trusted.string();
      component->info = std::make_shared<const ComponentInfo>(std::move(info));
    } else if (std::none_of(folders.begin(), folders.end(), [&](const fs::path& folder) {
                 return recorded.parent_path() == folder;  // it was there, and is gone
               })) {
      distrust("the plugin ", recorded);
    }
    for (const ResolvedValue& value : component->parameters.values) {
      if (!IsProgram(value) || IsUnder(value.choice, "/usr")) continue;
      if (std::none_of(folders.begin(), folders.end(),
                       [&](const fs::path& folder) { return IsUnder(value.choice, folder); })) {
        distrust("in '" + value.name + "' the program ", value.choice);
      }
    }
  }
  if (!named.empty()) {
    std::string advice;
    for (const std::string& flag : flags) advice += " " + flag;
    throw Failure(ExitCode::kPluginRefused,
                  who +
                      " names code that is in no folder of plugins, and a recorded run does not "
                      "decide what is loaded: " +
                      JoinNames(named) + ". If it is trusted, add" + advice);
  }
  std::vector<ParameterInfo> parameters;
  for (const ParameterSpec& parameter : kRunParameters) {
    parameters.push_back(DescribeParameter(parameter));
  }
  CheckValues(spec->run, parameters, who + ": run.");
}

}  // namespace dreamsearch
