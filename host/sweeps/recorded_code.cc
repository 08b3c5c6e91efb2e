#include "host/sweeps/recorded_code.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "host/plugins/catalogue.h"
#include "host/settings/run_parameters.h"
#include "host/settings/settings.h"
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

enum class Named { kNothing, kProgram, kModuleFile, kModuleName };

// What code a text names. Types are as recorded: whoever makes the component refuses other ones.
Named CodeNamedBy(const ResolvedValue& value) {
  const std::string& text = value.choice;
  if (!IsText(value.type) || text.empty()) return Named::kNothing;
  if (text.ends_with(".py") || text.ends_with(".so")) return Named::kModuleFile;
  if (text.find('/') == std::string::npos) {
    return value.type == ParameterType::kPath ? Named::kModuleName : Named::kNothing;
  }
  std::error_code error;
  return fs::is_regular_file(text, error) && ::access(text.c_str(), X_OK) == 0 ? Named::kProgram
                                                                               : Named::kNothing;
}

}  // namespace

void TrustRecordedCode(const TrustedCode& trusted, const std::string& who, RunSpec* spec) {
  const std::vector<fs::path> folders = PluginFolders(trusted.folders);
  std::vector<ResolvedComponent*> components = {&spec->environment, &spec->model, &spec->planner,
                                                &spec->eval_planner};
  if (spec->evaluation && spec->evaluation->trained_model) {
    components.push_back(&*spec->evaluation->trained_model);
  }
  // What is not trusted, in words, and the flags that would change that.
  std::vector<std::string> named, flags;
  const auto distrust = [&](const std::string& text, const std::string& flag) {
    if (std::find(flags.begin(), flags.end(), flag) == flags.end()) flags.push_back(flag);
    if (std::find(named.begin(), named.end(), text) == named.end()) named.push_back(text);
  };
  const auto folder_of = [](const fs::path& file) {
    return "--plugin-path " + ShellWord(fs::absolute(file).parent_path().string());
  };
  for (ResolvedComponent* component : components) {
    ComponentInfo info = *component->info;
    const fs::path recorded = info.plugin.path;
    const fs::path found = InFolders(folders, recorded.filename().string(), info.plugin.sha256);
    if (!found.empty()) {
      info.plugin.path = found.string();
      component->info = std::make_shared<const ComponentInfo>(std::move(info));
    } else if (std::none_of(folders.begin(), folders.end(), [&](const fs::path& folder) {
                 return recorded.parent_path() == folder;  // it was there, and is gone
               })) {
      distrust("the plugin " + recorded.string(), folder_of(recorded));
    }
    for (const ResolvedValue& value : component->parameters.values) {
      const Named code = CodeNamedBy(value);
      const std::string where = "in '" + value.name + "' the ";
      if (code == Named::kModuleName) {
        if (std::find(trusted.modules.begin(), trusted.modules.end(), value.choice) ==
            trusted.modules.end()) {
          distrust(where + "module " + value.choice, "--trust-module " + ShellWord(value.choice));
        }
        continue;
      }
      if (code == Named::kNothing || (code == Named::kProgram && IsUnder(value.choice, "/usr"))) {
        continue;
      }
      if (std::none_of(folders.begin(), folders.end(),
                       [&](const fs::path& folder) { return IsUnder(value.choice, folder); })) {
        distrust(where + (code == Named::kProgram ? "program " : "module ") + value.choice,
                 folder_of(value.choice));
      }
    }
  }
  if (!named.empty()) {
    std::string advice;
    for (const std::string& flag : flags) advice += " " + flag;
    throw Failure(ExitCode::kPluginRefused,
                  who +
                      " asks for code that the command does not name, and a recorded run does not "
                      "decide what is loaded: " +
                      JoinNames(named) + ". If it is trusted, add" + advice);
  }
  std::vector<ParameterInfo> parameters;
  for (const ParameterSpec& parameter : kRunParameters) {
    parameters.push_back(DescribeParameter(parameter));
  }
  AddLaterRunParameters(&spec->run);
  CheckValues(spec->run, parameters, who + ": run.");
}

}  // namespace dreamsearch
