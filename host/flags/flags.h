// flags.h - flags that several commands of `runner` have.
//
// Each is declared here once; a command takes those that mean something to it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "host/plugins/catalogue.h"
#include "host/settings/run_options.h"
#include "results/command_line/database_flag.h"
#include "results/command_line/values.h"

namespace dreamsearch {

// RUN, "a run's number or the beginning of its UUID".
Flag RunArgument(std::string* run);
Flag PluginPathFlag(std::vector<std::string>* plugin_path);
// --trust-module, of what goes on from a recorded run.
Flag TrustModuleFlag(std::vector<std::string>* modules);

// The plugins of that flag, which searches them; warnings go to standard error.
Catalogue ScanPlugins(const std::vector<std::string>& plugin_path);

// The components a text names: of one kind if it says so, otherwise of all; empty if
// there are none.
std::vector<std::shared_ptr<const ComponentInfo>> ComponentsNamed(const Catalogue& catalogue,
                                                                  const std::string& command,
                                                                  const std::string& text);

// --seeds and --seed-list; a command that has them lists them as exclusive.
std::vector<Flag> SeedFlags(std::vector<std::uint64_t>* seeds);
// --set.
Flag SetFlag(std::vector<Setting>* settings);
// A flag that sets one parameter: --steps sets "run.steps".
FlagValue SettingOf(std::vector<Setting>* settings, const std::string& key);
// A study's name: some text in UTF-8.
FlagValue StudyName(std::string* study);

// --db of a command that has ProcessOptions.
Flag DatabaseFlag(ProcessOptions* process);
// --db, --plugin-path, --jobs and what a run may use.
FlagGroup LimitFlags(ProcessOptions* process);
// The same and --scratch, for commands that write to that database (working_database.h).
FlagGroup WorkFlags(ProcessOptions* process);
// What to do with runs that were there before.
Flag RetryFlag(ProcessOptions* process);
Flag ReplaceFlag(ProcessOptions* process);
// --log-decisions and --record-trees.
std::vector<Flag> RecordingFlags(ProcessOptions* process);
Flag DryRunFlag(ProcessOptions* process);

// The file that --out names: in a folder, which is there or ends in a slash, `name`;
// `name` here if it is empty.
std::string OutputPath(const std::string& out, const std::string& name);

}  // namespace dreamsearch
