#include "host/flags/flags.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/names.h"

namespace dreamsearch {
namespace {

// Seeds are stored in SQLite integers, which are signed.
constexpr std::uint64_t kLargestSeed = std::numeric_limits<std::int64_t>::max();
constexpr std::uint64_t kMostSeeds = 1000000;

std::vector<std::uint64_t> ParseSeedCount(const std::string& text) {
  std::vector<std::uint64_t> seeds(ParseWhole(text, 1, kMostSeeds));
  for (std::uint64_t i = 0; i < seeds.size(); ++i) seeds[i] = i;
  return seeds;
}

std::vector<std::uint64_t> ParseSeedList(const std::string& text) {
  std::vector<std::uint64_t> seeds;
  for (const std::string& part : SplitCommas(text)) {
    const std::uint64_t seed = ParseWhole(part, 0, kLargestSeed);
    if (std::find(seeds.begin(), seeds.end(), seed) != seeds.end()) {
      throw std::invalid_argument("expected each seed once, and " + part + " twice");
    }
    seeds.push_back(seed);
  }
  if (seeds.empty()) throw std::invalid_argument("expected at least one seed");
  return seeds;
}

// The name goes into JSON and the database.
std::string ParseStudyName(const std::string& text) {
  if (text.empty()) throw std::invalid_argument("expected a name");
  try {
    static_cast<void>(results::JsonText(nlohmann::json(text)));
  } catch (const nlohmann::json::type_error&) {
    throw Failure(ExitCode::kUsage, "expected a name in UTF-8, found other bytes");
  }
  return text;
}

std::string Trimmed(const std::string& word) {
  const auto begin = word.find_first_not_of(" \t");
  if (begin == std::string::npos) return "";
  return word.substr(begin, word.find_last_not_of(" \t") - begin + 1);
}

// Begins a message about the setting, which names its key itself.
std::string WhereOf(const Given& given) { return given.from_file ? given.where : given.Where(); }

std::filesystem::path FolderOf(const Given& given) {
  return std::filesystem::path(given.file).parent_path();
}

Setting ParseSetting(const Given& given) {
  const auto equals = given.text.find('=');
  if (equals == std::string::npos || equals == 0 || given.text.find('.') > equals) {
    throw std::invalid_argument("expected key=value with a key such as planner.k");
  }
  return {Trimmed(given.text.substr(0, equals)), Trimmed(given.text.substr(equals + 1)),
          given.from_file, WhereOf(given), FolderOf(given)};
}

}  // namespace

namespace {

FlagValue Jobs(ProcessOptions* process) {
  return {[process](const Given& given) {
    const auto jobs = static_cast<int>(ParseWhole(given.text, 0, 10000));
    process->in_process = jobs == 0;
    process->jobs = std::max(jobs, 1);
  }};
}

}  // namespace

Flag RunArgument(std::string* run) {
  return {"", "RUN", Text(run).Required(),
          "the run's number or the beginning of its UUID, from `runner status`"};
}

Flag PluginPathFlag(std::vector<std::string>* plugin_path) {
  return {"plugin-path", "FOLDER", Texts(plugin_path),
          "search this folder for plugins first; $DREAMSEARCH_PLUGIN_PATH and the runner's own "
          "folders follow"};
}

Flag TrustModuleFlag(std::vector<std::string>* modules) {
  return {"trust-module", "NAME", Texts(modules),
          "let the recorded run import the installed module of this name that its settings ask "
          "for; a module that is a file must lie in a folder of --plugin-path"};
}

Catalogue ScanPlugins(const std::vector<std::string>& plugin_path) {
  ScanOptions options;
  options.known = ReadKnownPlugins();
  Catalogue catalogue = Catalogue::Scan(PluginFolders(plugin_path), options);
  for (const std::string& warning : catalogue.warnings()) {
    std::cerr << "warning: " << warning << "\n";
  }
  return catalogue;
}

std::vector<Flag> SeedFlags(std::vector<std::uint64_t>* seeds) {
  return {{"seeds", "N", Parsed(seeds, ParseSeedCount).Default("1"), "run the seeds 0 to N-1"},
          {"seed-list", "A,B,...", Parsed(seeds, ParseSeedList), "run these seeds"}};
}

Flag SetFlag(std::vector<Setting>* settings) {
  return {
      "set",
      "KEY=VALUE",
      {[settings](const Given& given) { settings->push_back(ParseSetting(given)); },
       FlagValue::Takes::kTexts},
      "set a parameter: planner.k for every planner that declares k, mcts_pw.k for one, "
      "model.k, env.k or run.k; `runner describe NAME` lists them. In a shell a value with blanks, "
      "brackets or < needs single quotes around it; a relative path begins in the folder in "
      "which the command is typed"};
}

FlagValue SettingOf(std::vector<Setting>* settings, const std::string& key) {
  return {[settings, key](const Given& given) {
    settings->push_back({key, given.text, given.from_file, WhereOf(given), FolderOf(given)});
  }};
}

FlagValue StudyName(std::string* study) { return Parsed(study, ParseStudyName).Default(*study); }

Flag DatabaseFlag(ProcessOptions* process) {
  const auto path = [](const std::string& text) { return std::filesystem::path(text); };
  return {"db", "FILE", Parsed(&process->db, path).Default(process->db.string()),
          "the results database"};
}

FlagGroup LimitFlags(ProcessOptions* process) {
  return {"Where and within which limits",
          {DatabaseFlag(process),
           PluginPathFlag(&process->plugin_path),
           {"jobs", "N", Jobs(process).Default("what the cores and the memory allow"),
            "run this many worker processes at once; a run learns on the cores that no other "
            "run needs, with the same results. 0: in this process, one run after the other, for a "
            "debugger"},
           {"time-limit", "TIME", Duration(&process->time_limit_seconds).Default("0, no limit"),
            "end a run after this time, in seconds or as 30m or 2h"},
           {"memory-limit", "SIZE",
            Size(&process->memory_limit_bytes).Default("the free memory, divided by --jobs"),
            "end a run whose process takes more memory than this (its resident size), in bytes or "
            "as 512M or 4G; 0: never"},
           {"nice", "N", Whole(&process->nice, 0, 19).Default("0"),
            "run with this much lower priority than other programs, up to 19"},
           {"hang-timeout", "TIME", Duration(&process->hang_timeout_seconds).Default("60"),
            "end a run that makes no progress for this much processor time, in seconds or as 5m, "
            "times the number of decisions that it makes at once; 0: never"}}};
}

FlagGroup WorkFlags(ProcessOptions* process) {
  const auto path = [](const std::string& text) { return std::filesystem::path(text); };
  FlagGroup group = LimitFlags(process);
  group.flags.push_back(
      {"scratch", "DIR", Parsed(&process->scratch, path),
       "keep the database in this folder of this machine while runs are active, and put it back "
       "whole every 10 minutes and at the end; for shared file systems"});
  return group;
}

Flag RetryFlag(ProcessOptions* process) {
  return {"retry", "", Switch(&process->retry), "run failed, crashed and diverged runs again"};
}

Flag ReplaceFlag(ProcessOptions* process) {
  return {"replace", "", Switch(&process->replace),
          "start an unfinished run over and delete what it recorded if it cannot resume: one of "
          "its plugins has changed, or none of its checkpoints is usable"};
}

std::vector<Flag> RecordingFlags(ProcessOptions* process) {
  return {{"log-decisions", "", Switch(&process->log_decisions),
           "store a row of search statistics for every decision"},
          {"record-trees", "", Switch(&process->record_trees),
           "keep the search trees of training decisions for `runner explain`"},
          {"keep-replay", "", Switch(&process->keep_replay),
           "keep what a finished run needs to go on past its budget (`runner extend`): a "
           "checkpoint with the whole replay, 4 bytes for each number observed, acted and "
           "rewarded, before its last action"}};
}

Flag DryRunFlag(ProcessOptions* process) {
  return {"dry-run", "", Switch(&process->dry_run),
          "show the runs, their settings and an estimate of time and space; run nothing"};
}

std::string OutputPath(const std::string& out, const std::string& name) {
  std::error_code error;
  const bool folder = out.ends_with('/') || std::filesystem::is_directory(out, error);
  return out.empty() ? name : folder ? (std::filesystem::path(out) / name).string() : out;
}

std::vector<std::shared_ptr<const ComponentInfo>> ComponentsNamed(const Catalogue& catalogue,
                                                                  const std::string& command,
                                                                  const std::string& text) {
  const auto slash = text.find('/');
  const std::string name = slash == std::string::npos ? text : text.substr(slash + 1);
  const std::string kind_name = slash == std::string::npos ? "" : text.substr(0, slash);
  const std::vector<ComponentKind> kinds = {ComponentKind::kEnvironment, ComponentKind::kModel,
                                            ComponentKind::kPlanner};
  if (!kind_name.empty()) {
    for (const ComponentKind kind : kinds) {
      const bool short_name = kind == ComponentKind::kEnvironment && kind_name == "env";
      if (short_name || kind_name == ComponentKindName(kind)) return {catalogue.Find(kind, name)};
    }
    throw Failure(ExitCode::kUsage, command + ": no kind '" + kind_name + "'. " +
                                        KnownNames(kind_name, {"environment", "model", "planner"}));
  }
  std::vector<std::shared_ptr<const ComponentInfo>> found;
  for (const ComponentKind kind : kinds) {
    try {
      found.push_back(catalogue.Find(kind, name));
    } catch (const Failure& error) {
      // Of no such name here: perhaps of another kind. Anything else is the answer.
      if (error.code() != ExitCode::kNotFound) throw;
    }
  }
  return found;
}

}  // namespace dreamsearch
