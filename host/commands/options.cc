#include "host/commands/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "host/settings/cores.h"
#include "results/system/file.h"
#include "results/system/json_text.h"
#include "results/system/names.h"

namespace dreamsearch {
namespace {

namespace po = boost::program_options;

[[noreturn]] void Usage(const std::string& message) { throw Failure(ExitCode::kUsage, message); }

// --- single values -----------------------------------------------------------

// Every parser throws std::invalid_argument with what was expected; the caller
// adds where.
std::uint64_t ParseCount(const std::string& text, std::uint64_t low, std::uint64_t high) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high) {
    throw std::invalid_argument("expected an integer from " + std::to_string(low) + " to " +
                                std::to_string(high));
  }
  return value;
}

// A number and the suffix after it.
std::pair<double, std::string> ParseMeasure(const std::string& text, const std::string& expected) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || !std::isfinite(value) || value < 0) {
    throw std::invalid_argument(expected);
  }
  return {value, std::string(end, text.data() + text.size())};
}

double ParseSeconds(const std::string& text) {
  const std::string expected = "expected a duration such as 90, 90s, 30m or 2h (0: no limit)";
  const auto [value, suffix] = ParseMeasure(text, expected);
  if (suffix.empty() || suffix == "s") return value;
  if (suffix == "m") return value * 60;
  if (suffix == "h") return value * 3600;
  if (suffix == "d") return value * 86400;
  throw std::invalid_argument(expected);
}

std::uint64_t ParseBytes(const std::string& text) {
  const std::string expected =
      "expected a size such as 512M, 4G or a number of bytes (0: no limit)";
  const auto [value, suffix] = ParseMeasure(text, expected);
  static const std::map<std::string, double> kFactors = {
      {"", 1},       {"K", 0x1p10}, {"k", 0x1p10}, {"M", 0x1p20},
      {"m", 0x1p20}, {"G", 0x1p30}, {"g", 0x1p30}, {"T", 0x1p40}};
  const auto factor = kFactors.find(suffix);
  if (factor == kFactors.end() || value * factor->second > 0x1p62) {
    throw std::invalid_argument(expected);
  }
  return static_cast<std::uint64_t>(value * factor->second);
}

std::vector<std::string> SplitCommas(const std::string& text) {
  std::vector<std::string> parts;
  std::stringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  if (text.ends_with(',')) parts.emplace_back();
  return parts;
}

// "a,b": names that are not empty and differ.
std::vector<std::string> ParseNames(const std::string& text) {
  const std::vector<std::string> names = SplitCommas(text);
  std::set<std::string> seen;
  if (names.empty()) throw std::invalid_argument("expected a name or a list a,b");
  for (const std::string& name : names) {
    if (name.empty()) throw std::invalid_argument("expected names between the commas");
    if (!seen.insert(name).second) {
      throw std::invalid_argument("expected each name once, '" + name + "' is there twice");
    }
  }
  return names;
}

// Seeds are stored in SQLite integers, which are signed.
constexpr std::uint64_t kLargestSeed = std::numeric_limits<std::int64_t>::max();
constexpr std::uint64_t kMostSeeds = 1000000;

std::vector<std::uint64_t> ParseSeedList(const std::string& text) {
  std::vector<std::uint64_t> seeds;
  for (const std::string& part : SplitCommas(text)) {
    const std::uint64_t seed = ParseCount(part, 0, kLargestSeed);
    if (std::find(seeds.begin(), seeds.end(), seed) != seeds.end()) {
      throw std::invalid_argument("expected each seed once, " + part + " is there twice");
    }
    seeds.push_back(seed);
  }
  if (seeds.empty()) throw std::invalid_argument("expected at least one seed");
  return seeds;
}

// The name goes into JSON and the database.
bool IsUtf8(const std::string& text) {
  try {
    static_cast<void>(results::JsonText(nlohmann::json(text)));
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

// --- declarations ------------------------------------------------------------

// Values that need more than Boost's conversion are read as text by these.
auto Text(const char* name, std::function<void(const std::string&)> read) {
  return po::value<std::string>()->value_name(name)->notifier(
      [read = std::move(read)](const std::string& text) { read(text); });
}

// The parsers' messages name no flag; this does.
auto Named(std::string flag, std::function<void(const std::string&)> read) {
  return [flag = std::move(flag), read = std::move(read)](const std::string& text) {
    try {
      read(text);
    } catch (const std::invalid_argument& error) {
      constexpr std::size_t kMost = 60;
      Usage("--" + flag + ": " + error.what() + ", found '" +
            (text.size() > kMost ? text.substr(0, kMost) + "...'" : text + "'"));
    }
  };
}

po::options_description ChoiceFlags(Options* options) {
  po::options_description flags("What to run");
  const auto names = [](const char* flag, std::vector<std::string>* list) {
    return Text("NAMES",
                Named(flag, [list](const std::string& text) { *list = ParseNames(text); }));
  };
  flags.add_options()("env", names("env", &options->environments), "tasks, comma separated")(
      "planner", names("planner", &options->planners), "planners, comma separated")(
      "model", names("model", &options->models), "models, comma separated (dreamer)")(
      "eval-planner", po::value(&options->eval_planner)->value_name("NAME"),
      "planner of the with-search evaluation (the run's own)")(
      "seeds",
      Text("N", Named("seeds",
                      [options](const std::string& text) {
                        const std::uint64_t count = ParseCount(text, 1, kMostSeeds);
                        for (std::uint64_t seed = 0; seed < count; ++seed)
                          options->seeds.push_back(seed);
                      })),
      "run seeds 0 .. N-1 (1)")("seed-list",
                                Text("A,B,...", Named("seed-list",
                                                      [options](const std::string& text) {
                                                        options->seeds = ParseSeedList(text);
                                                      })),
                                "run these seeds");
  return flags;
}

po::options_description SettingFlags(Options* options) {
  po::options_description flags("How");
  flags.add_options()("preset", po::value(&options->preset)->value_name("NAME"),
                      "fast (sized for a CPU) or paper (the paper's sizes and schedule) (fast)")(
      "steps", po::value<std::string>()->value_name("N"),
      "environment steps a run, before action repeat (the preset's)")(
      "set", po::value<std::vector<std::string>>()->value_name("KEY=VALUE")->composing(),
      "any declared parameter: planner.k for every listed planner that declares k, mcts_pw.k "
      "for one, model.k, env.k, run.k; `runner describe NAME` lists them")(
      "config", po::value(&options->config)->value_name("FILE"),
      "read flags from a file, name = value a line; the command line wins")(
      "study", po::value(&options->study)->value_name("NAME"),
      "named comparison the runs belong to (default)");
  return flags;
}

po::options_description EvaluationFlags(EvaluationOptions* evaluation) {
  Options* options = &evaluation->choice;
  po::options_description flags("What to evaluate");
  const auto names = [](const char* flag, std::vector<std::string>* list) {
    return Text("NAMES",
                Named(flag, [list](const std::string& text) { *list = ParseNames(text); }));
  };
  flags.add_options()("run", po::value(&evaluation->run)->value_name("RUN"),
                      "the trained run: its number or the beginning of its UUID")(
      "planner", names("planner", &options->planners), "planners, comma separated")(
      "model", names("model", &options->models),
      "models, comma separated (the run's own; oracle without RUN)")(
      "episodes", po::value<std::string>()->value_name("N"),
      "episodes a planner and model (run.eval_episodes)")(
      "env", names("env", &options->environments), "tasks, comma separated; without RUN")(
      "seeds",
      Text("N", Named("seeds",
                      [options](const std::string& text) {
                        const std::uint64_t count = ParseCount(text, 1, kMostSeeds);
                        for (std::uint64_t seed = 0; seed < count; ++seed)
                          options->seeds.push_back(seed);
                      })),
      "run seeds 0 .. N-1, each with episodes of its own; without RUN (1)")(
      "seed-list",
      Text("A,B,...",
           Named("seed-list",
                 [options](const std::string& text) { options->seeds = ParseSeedList(text); })),
      "these run seeds; without RUN")(
      "study", po::value<std::string>()->value_name("NAME"),
      "named comparison the evaluations belong to; without RUN (default)")(
      "preset", po::value<std::string>()->value_name("NAME"),
      "preset of planners and models that the run did not train with (the run's; fast)")(
      "set", po::value<std::vector<std::string>>()->value_name("KEY=VALUE")->composing(),
      "a parameter: planner.k, mcts_pw.k, model.k, env.k; without RUN also "
      "run.action_repeat")("help,h", "show this text");
  return flags;
}

po::options_description GeneralFlags(Options* options) {
  po::options_description flags("General");
  flags.add_options()("help,h", po::bool_switch(&options->help), "show this text")(
      "version", po::bool_switch(&options->version), "show the version");
  return flags;
}

po::options_description AllFlags(Options* options) {
  po::options_description flags;
  flags.add(ChoiceFlags(options))
      .add(SettingFlags(options))
      .add(ProcessFlags(&options->process))
      .add(GeneralFlags(options));
  return flags;
}

// "env", "planner", ...: the long names.
std::vector<std::string> LongNames(const po::options_description& flags, const char* dashes) {
  std::vector<std::string> names;
  for (const auto& flag : flags.options()) names.push_back(dashes + flag->long_name());
  return names;
}

// --- errors ------------------------------------------------------------------

// Runs a Boost parser and turns its errors into ours. `where` begins the message.
template <typename Action>
auto WithClearErrors(const std::string& where, ExitCode code, const char* dashes,
                     const po::options_description& flags, Action action) {
  const auto fail = [&](const std::string& message) -> void {
    throw Failure(code, where + ": " + message);
  };
  try {
    return action();
  } catch (const Failure& error) {
    fail(error.what());
  } catch (const po::unknown_option& error) {
    std::string name = error.get_option_name();
    name.erase(0, name.find_first_not_of('-'));
    fail("no option '" + (dashes + name) + "'. " +
         KnownNames(dashes + name, LongNames(flags, dashes)));
  } catch (const po::multiple_occurrences& error) {
    fail("'" + error.get_option_name() + "' is given twice; expected it once");
  } catch (const po::invalid_command_line_syntax& error) {
    if (error.kind() == po::invalid_syntax::missing_parameter) {
      fail("'" + error.get_option_name() + "' expects a value, found none");
    } else if (error.kind() == po::invalid_syntax::extra_parameter) {
      fail("'" + error.get_option_name() + "' takes no value");
    } else {
      fail(error.what());
    }
  } catch (const po::too_many_positional_options_error&) {
    fail("found an argument that belongs to no flag");
  } catch (const po::validation_error& error) {
    fail(error.what());
  } catch (const po::error& error) {
    fail(error.what());
  }
  throw Failure(ExitCode::kInternal, "unreachable");
}

// --- the configuration file --------------------------------------------------

struct FileOption {
  po::option option;
  std::string where;  // path and line
};

std::string ReadFile(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) {
    throw Failure(ExitCode::kNotFound, "no configuration file " + file);
  }
  if (std::filesystem::is_directory(file, error)) {
    throw Failure(ExitCode::kBadInput, "expected a configuration file, " + file + " is a folder");
  }
  constexpr std::uintmax_t kMostBytes = 1 << 20;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Failure(ExitCode::kPermission, "cannot read " + file);
  std::string text(kMostBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (stream.bad()) throw Failure(ExitCode::kInputOutput, "cannot read " + file);
  if (text.size() > kMostBytes) {
    throw Failure(ExitCode::kBadInput, "configuration file " + file +
                                           " is larger than 1 MB; expected flags, one a line");
  }
  return text;
}

// Reads the file a line at a time, so that every message can name the line.
// A byte order mark and carriage returns are nothing.
std::vector<FileOption> ReadConfiguration(const std::string& path,
                                          const po::options_description& flags) {
  const std::string file = std::filesystem::absolute(path).lexically_normal().string();
  std::string text = ReadFile(file);
  if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);
  std::vector<FileOption> found;
  std::map<std::string, int> first_line;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.ends_with('\r')) line.pop_back();
    const std::string where = file + ", line " + std::to_string(number);
    const auto fail = [&](const std::string& message) {
      throw Failure(ExitCode::kBadInput, where + ": " + message);
    };
    for (const char c : line) {
      if ((c >= 0 && c < 0x20 && c != '\t') || c == 0x7f) {
        fail("found a control character; expected text");
      }
    }
    const std::string content = line.substr(0, line.find('#'));
    if (content.find_first_not_of(" \t") == std::string::npos) continue;
    if (content.find('=') == std::string::npos) {
      fail("expected name = value, found '" + content.substr(0, 60) + "'");
    }
    std::istringstream one(line);
    const po::parsed_options parsed = WithClearErrors(
        where, ExitCode::kBadInput, "", flags, [&] { return po::parse_config_file(one, flags); });
    for (const po::option& option : parsed.options) {
      const std::string& name = option.string_key;
      if (name == "config" || name == "help" || name == "version") {
        fail("'" + name + "' is for the command line only");
      }
      if (option.value.empty() || option.value[0].empty()) {
        fail("'" + name + "' expects a value, found none");
      }
      if (name != "set" && name != "plugin-path") {
        const auto [before, added] = first_line.try_emplace(name, number);
        if (!added) {
          fail("'" + name + "' is given twice; it was on line " + std::to_string(before->second) +
               " already");
        }
      }
      found.push_back({option, where});
    }
  }
  return found;
}

Setting ParseSetting(const std::string& text, bool from_file, const std::string& where) {
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || text.find('.') > equals) {
    throw Failure(from_file ? ExitCode::kBadInput : ExitCode::kUsage,
                  where + ": set: expected key=value with a key such as planner.k, found '" +
                      text.substr(0, 60) + "'");
  }
  const auto trim = [](std::string word) {
    const auto begin = word.find_first_not_of(" \t");
    if (begin == std::string::npos) return std::string();
    return word.substr(begin, word.find_last_not_of(" \t") - begin + 1);
  };
  return {trim(text.substr(0, equals)), trim(text.substr(equals + 1)), from_file, where};
}

// The file's options that the command line leaves standing, each checked; `set`
// and `steps` go to *settings.
po::parsed_options FromFile(const std::string& path, const po::options_description& flags,
                            const po::variables_map& given, std::vector<Setting>* settings) {
  po::parsed_options kept(&flags);
  std::string seeds_where;
  for (const FileOption& entry : ReadConfiguration(path, flags)) {
    const std::string& name = entry.option.string_key;
    // Checked even if the command line hides it: a mistake in a file should not
    // wait for its day.
    WithClearErrors(entry.where, ExitCode::kBadInput, "", flags, [&] {
      Options scratch;
      const po::options_description scratch_flags = AllFlags(&scratch);
      po::parsed_options one(&scratch_flags);
      one.options.push_back(entry.option);
      po::variables_map values;
      po::store(one, values);
      po::notify(values);
      return 0;
    });
    const bool seeds = name == "seeds" || name == "seed-list";
    if (seeds && !seeds_where.empty()) {
      throw Failure(ExitCode::kBadInput,
                    entry.where + ": expected seeds or seed-list, found both; the other is in " +
                        seeds_where);
    }
    if (seeds) seeds_where = entry.where;
    if (name == "set") {
      settings->push_back(ParseSetting(entry.option.value[0], true, entry.where));
    } else if (name == "steps") {
      settings->push_back({"run.steps", entry.option.value[0], true, entry.where});
    } else if (!(seeds && (given.contains("seeds") || given.contains("seed-list")))) {
      kept.options.push_back(entry.option);
    }
  }
  return kept;
}

po::parsed_options ParseArguments(const std::vector<std::string>& arguments,
                                  const po::options_description& flags,
                                  const po::positional_options_description& positional) {
  // Only -h is short, so that "-1" is a value and not a flag; no abbreviations,
  // so that a new flag never changes what an old command means.
  namespace style = po::command_line_style;
  std::vector<std::string> words = arguments;
  for (std::string& word : words) {
    if (word == "-h") word = "--help";
  }
  return po::command_line_parser(words)
      .options(flags)
      .positional(positional)
      .style(style::allow_long | style::long_allow_adjacent | style::long_allow_next)
      .run();
}

constexpr const char* kCommandLine = "runner";

void AddRetryFlag(ProcessOptions* process, po::options_description* flags) {
  flags->add_options()("retry", po::bool_switch(&process->retry),
                       "run failed, crashed and diverged runs again");
}

void AddReplaceFlag(ProcessOptions* process, po::options_description* flags) {
  flags->add_options()(
      "replace", po::bool_switch(&process->replace),
      "start an unfinished run over that cannot go on: a plugin of it has changed, or none of its "
      "checkpoints is whole and of the database's rows; deletes what it recorded");
}

void AddRecordingFlags(ProcessOptions* process, po::options_description* flags) {
  flags->add_options()("log-decisions", po::bool_switch(&process->log_decisions),
                       "store a row of search statistics for every decision")(
      "record-trees", po::bool_switch(&process->record_trees),
      "keep the search trees of training decisions for `runner explain`")(
      "dry-run", po::bool_switch(&process->dry_run),
      "print the runs, their settings and an estimate; run nothing");
}

}  // namespace

std::string OutputPath(const std::string& out, const std::string& name) {
  std::error_code error;
  const bool folder = out.ends_with('/') || std::filesystem::is_directory(out, error);
  return out.empty() ? name : folder ? (std::filesystem::path(out) / name).string() : out;
}

po::options_description PluginPathFlag(std::vector<std::string>* plugin_path) {
  po::options_description flags("Plugins");
  flags.add_options()(
      "plugin-path", po::value(plugin_path)->value_name("FOLDER")->composing(),
      "search this folder for plugins first; then $DREAMSEARCH_PLUGIN_PATH, then the runner's "
      "own");
  return flags;
}

po::options_description LimitFlags(ProcessOptions* process) {
  process->jobs = static_cast<int>(AvailableCores().count);
  po::options_description flags("Where and within which limits");
  flags.add_options()("db",
                      po::value<std::string>()->value_name("FILE")->notifier(
                          [process](const std::string& text) { process->db = text; }),
                      "results database (results/dreamsearch.db)")(
      "plugin-path", po::value(&process->plugin_path)->value_name("FOLDER")->composing(),
      "search this folder for plugins first; then $DREAMSEARCH_PLUGIN_PATH, then the runner's "
      "own")("jobs",
             Text("N", Named("jobs",
                             [process](const std::string& text) {
                               process->jobs = static_cast<int>(ParseCount(text, 1, 10000));
                             })),
             "worker processes at once (the number of cores); a run learns on the cores that no "
             "other run needs, with the same results")(
      "time-limit",
      Text("TIME", Named("time-limit",
                         [process](const std::string& text) {
                           process->time_limit_seconds = ParseSeconds(text);
                         })),
      "end a run after this time, in seconds or as 30m, 2h; 0: no limit (0)")(
      "memory-limit",
      Text("SIZE", Named("memory-limit",
                         [process](const std::string& text) {
                           process->memory_limit_bytes = ParseBytes(text);
                         })),
      "end a run that uses more memory, in bytes or as 512M, 4G; 0: no limit (0)")(
      "hang-timeout",
      Text("TIME", Named("hang-timeout",
                         [process](const std::string& text) {
                           process->hang_timeout_seconds = ParseSeconds(text);
                         })),
      "end a run that uses so much processor time, in seconds or as 5m, without a sign of "
      "life; for each of the decisions that an evaluation makes side by side; 0: never (60)");
  return flags;
}

po::options_description EvaluationProcessFlags(ProcessOptions* process) {
  po::options_description flags = LimitFlags(process);
  AddRetryFlag(process, &flags);
  AddReplaceFlag(process, &flags);
  return flags;
}

po::options_description ResumeFlags(ProcessOptions* process) {
  po::options_description flags = LimitFlags(process);
  AddRetryFlag(process, &flags);
  AddRecordingFlags(process, &flags);
  return flags;
}

po::options_description ProcessFlags(ProcessOptions* process) {
  po::options_description flags = LimitFlags(process);
  AddRetryFlag(process, &flags);
  AddReplaceFlag(process, &flags);
  AddRecordingFlags(process, &flags);
  return flags;
}

po::variables_map ParseFlags(const std::string& command, const std::vector<std::string>& arguments,
                             const po::options_description& flags,
                             const po::positional_options_description& positional) {
  // Boost tells of a surplus argument without naming it.
  return WithClearErrors(command, ExitCode::kUsage, "--", flags, [&] {
    po::options_description all;
    po::positional_options_description catching = positional;
    const bool limited = positional.max_total_count() != std::numeric_limits<unsigned>::max();
    all.add(flags);
    if (limited) {
      all.add_options()("surplus-argument", po::value<std::vector<std::string>>());
      catching.add("surplus-argument", -1);
    }
    const po::parsed_options parsed = ParseArguments(arguments, all, catching);
    po::variables_map values;
    po::store(parsed, values);
    if (values.contains("surplus-argument")) {
      const auto& surplus = values["surplus-argument"].as<std::vector<std::string>>();
      std::string message = "did not expect the argument '" + surplus.front() + "'";
      const auto near = NearestNames("--" + surplus.front(), LongNames(flags, "--"));
      if (!near.empty()) message += ". Did you mean " + near.front() + "?";
      Usage(message);
    }
    po::notify(values);
    return values;
  });
}

Options ParseOptions(const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    Options asked;
    asked.help = argument == "--help" || argument == "-h";
    asked.version = argument == "--version";
    if (asked.help || asked.version) return asked;
  }
  // The command line alone first: it is checked whole, and names the file.
  Options scratch;
  const po::variables_map given = ParseFlags(kCommandLine, arguments, AllFlags(&scratch));
  if (given.contains("seeds") && given.contains("seed-list")) {
    Usage("runner: expected --seeds or --seed-list, found both");
  }

  Options options;
  const po::options_description flags = AllFlags(&options);
  po::parsed_options from_file(&flags);
  if (!scratch.config.empty()) {
    from_file = FromFile(scratch.config, flags, given, &options.settings);
  }
  // Boost keeps what was stored first and joins the lists.
  po::variables_map values;
  po::store(ParseArguments(arguments, flags, {}), values);
  po::store(from_file, values);
  po::notify(values);

  if (given.contains("steps")) {
    options.settings.push_back(
        {"run.steps", given["steps"].as<std::string>(), false, "runner: --steps"});
  }
  if (given.contains("set")) {
    for (const std::string& text : given["set"].as<std::vector<std::string>>()) {
      options.settings.push_back(ParseSetting(text, false, "runner: --set"));
    }
  }
  const std::string hint =
      " (for example: runner --env walker_walk --planner mcts_pw --seeds 3); `runner list` shows "
      "what there is";
  if (options.environments.empty()) Usage("runner: expected a task, --env NAME" + hint);
  if (options.planners.empty()) Usage("runner: expected a planner, --planner NAME" + hint);
  if (options.study.empty()) Usage("runner: --study: expected a name, found nothing");
  if (!IsUtf8(options.study)) Usage("runner: --study: expected a name in UTF-8");
  if (options.seeds.empty()) options.seeds = {0};
  return options;
}

EvaluationOptions ParseEvaluationOptions(const std::vector<std::string>& arguments) {
  const std::string command = "runner eval";
  EvaluationOptions evaluation;
  Options& options = evaluation.choice;
  options.evaluate = true;
  options.preset.clear();
  options.study.clear();
  for (const std::string& argument : arguments) {
    options.help = options.help || argument == "--help" || argument == "-h";
  }
  if (options.help) return evaluation;
  po::options_description flags = EvaluationFlags(&evaluation);
  flags.add(EvaluationProcessFlags(&options.process));
  po::positional_options_description positional;
  positional.add("run", 1);
  const po::variables_map given = ParseFlags(command, arguments, flags, positional);
  if (given.contains("episodes")) {
    options.settings.push_back({"run.eval_episodes", given["episodes"].as<std::string>(), false,
                                command + ": --episodes"});
  }
  if (given.contains("set")) {
    for (const std::string& text : given["set"].as<std::vector<std::string>>()) {
      const Setting setting = ParseSetting(text, false, command + ": --set");
      const bool of_run = setting.key.starts_with("run.");
      if (of_run && (!evaluation.run.empty() || setting.key != "run.action_repeat")) {
        Usage(setting.where + ": " + setting.key +
              (evaluation.run.empty()
                   ? ": nothing is trained; expected run.action_repeat or a parameter of env, "
                     "model or a planner, and --episodes for their number"
                   : ": the trained run's settings stay; expected a parameter of a planner or a "
                     "model, and --episodes for their number"));
      }
      options.settings.push_back(setting);
    }
  }
  const std::string example =
      evaluation.run.empty()
          ? " (for example: runner eval --env cartpole_swingup --planner random,cem)"
          : " (for example: runner eval " + evaluation.run + " --planner dreamer,mcts_pw)";
  if (options.planners.empty()) Usage(command + ": expected a planner, --planner NAME" + example);
  if (given.contains("seeds") && given.contains("seed-list")) {
    Usage(command + ": expected --seeds or --seed-list, found both");
  }
  if (evaluation.run.empty()) {
    if (options.environments.empty()) {
      Usage(command + ": expected a trained run or a task, RUN or --env NAME" + example);
    }
    options.study = given.contains("study") ? given["study"].as<std::string>() : "default";
    if (options.study.empty()) Usage(command + ": --study: expected a name, found nothing");
    if (!IsUtf8(options.study)) Usage(command + ": --study: expected a name in UTF-8");
    if (options.seeds.empty()) options.seeds = {0};
  } else {
    for (const char* flag : {"env", "seeds", "seed-list", "study"}) {
      if (given.contains(flag)) {
        Usage(command + ": --" + flag + " is the trained run's; expected RUN or --" + flag +
              ", found both");
      }
    }
  }
  options.preset = given.contains("preset") ? given["preset"].as<std::string>()
                   : evaluation.run.empty() ? "fast"
                                            : "";
  return evaluation;
}

std::string EvaluationHelp() {
  EvaluationOptions evaluation;
  std::ostringstream text;
  text << R"(runner eval - plays evaluation episodes of a trained agent, under any planner

Usage
  runner eval RUN --planner NAMES [--model NAMES] [flags]    a trained run's newest checkpoint
  runner eval --env NAMES --planner NAMES [flags]            no training: on the oracle

Examples
  runner eval 3 --planner dreamer,rollout,mcts_pw --episodes 20
  runner eval 3 --planner mcts_pw --model dreamer,oracle --episodes 20
  runner eval --env cartpole_swingup,reacher_easy --planner random,cem,mppi --episodes 20

The model `oracle` is the simulator itself. With RUN it takes proposal and value from the
trained actor and critic, so that the second example tells the planner's error from the
model's. Without RUN it proposes uniform random actions and values everything 0: the planner
`random` is then the baseline (`dreamer` plays the action 0). A planner that the run trained
or evaluated with keeps the run's settings, others have those of the preset; --set changes any.

Episode i starts in the same state under every planner and model of a run seed. The table on
standard output says for each the mean return and its standard error, milliseconds a decision
and model transitions a decision; --jobs 1 plays one episode at a time, for times that are not
disturbed. Every evaluation is a run of the database that names its parent. The same command
again plays only what is missing.

)";
  ProcessOptions process;
  text << EvaluationFlags(&evaluation) << '\n' << EvaluationProcessFlags(&process);
  return text.str();
}

std::string RunnerHelp() {
  Options options;
  std::ostringstream text;
  text << R"(runner - trains agents that look ahead in learned latent spaces, and records them

Usage
  runner --env NAMES --planner NAMES [flags]      train every combination
  runner COMMAND [arguments]                      see Commands

Examples
  runner --env walker_walk --planner mcts_pw --seeds 3
  runner --env walker_walk,cartpole_swingup --planner dreamer,rollout,mcts_pw \
         --seeds 3 --study first --set planner.noise_std=0.2 --dry-run
  runner --config experiments/quickstart.cfg --steps 20000

The same command again skips what is finished and goes on with what is not.
Defaults are in parentheses.

)";
  text << ChoiceFlags(&options) << '\n'
       << SettingFlags(&options) << '\n'
       << ProcessFlags(&options.process) << '\n'
       << GeneralFlags(&options);
  text << R"(
Commands
  list [KIND]             components of all plugins: environments, models, planners
  describe [KIND/]NAME    a component's parameters, presets and metrics
  status                  what runs and what has run
  check FILE.so           the conformance suite on a plugin
  resume [RUN|STUDY|all]  go on with interrupted runs
  eval RUN                evaluate a trained agent, under any planner
  verify RUN              repeat a run and compare
  export RUN              write a trained model's weights
  explain RUN             show the search tree of a decision
  render RUN              make a video of an episode
  new KIND NAME           start a plugin project
  COMMAND --help          says more

Exit status
  0 ok, 2 usage, 65 bad input, 66 not found, 69 plugin refused, 70 internal error,
  71 plugin crashed, 72 diverged, 73 cannot create, 74 input/output, 75 interrupted,
  77 permission, 78 verification failed. Of several runs: 75 if stopped, else that of the
  first that is not 0, those that failed before and are left alone included
)";
  return text.str();
}

}  // namespace dreamsearch
