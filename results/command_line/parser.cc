#include "results/command_line/parser.h"

#include <algorithm>
#include <boost/program_options.hpp>
#include <cctype>
#include <set>
#include <sstream>

#include "results/system/error.h"
#include "results/text/names.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

namespace po = boost::program_options;

po::options_description Described(const CommandSpec& spec) {
  po::options_description described;
  for (const FlagGroup& group : spec.groups) {
    for (const Flag& flag : group.flags) {
      if (flag.value.takes == FlagValue::Takes::kNothing) {
        described.add_options()(flag.name.c_str(), po::bool_switch(), "");
      } else {
        described.add_options()(flag.name.c_str(), po::value<std::string>(), "");
      }
    }
  }
  return described;
}

std::vector<std::string> FlagNames(const CommandSpec& spec, const std::string& dashes) {
  std::vector<std::string> names;
  for (const FlagGroup& group : spec.groups) {
    for (const Flag& flag : group.flags) names.push_back(dashes + flag.name);
  }
  return names;
}

std::string SeeHelp(const CommandSpec& spec) {
  return " `" + spec.name + " --help` lists the flags.";
}

// " Did you mean --seeds? `runner --help` lists the flags."
std::string FlagHint(const CommandSpec& spec, const std::string& dashes, const std::string& name) {
  // A parameter of a component is no flag of its own.
  if (name.find('.') != std::string::npos && spec.Find("set") != nullptr) {
    return " A parameter is set with " + dashes + "set" + (dashes.empty() ? " = " : " ") +
           Printable(name) + "=VALUE.";
  }
  std::vector<std::string> known = FlagNames(spec, dashes);
  if (!dashes.empty()) known.insert(known.end(), {"--help", "--version"});
  return DidYouMean(dashes + name, known) + SeeHelp(spec);
}

// Calls a parser of Boost and turns its errors into ours.
template <typename Parse>
std::vector<po::option> Parsed(const CommandSpec& spec, const std::string& where, ExitCode code,
                               const std::string& dashes, Parse parse) {
  std::string message;
  try {
    return parse().options;
  } catch (const po::unknown_option& error) {
    std::string name = error.get_option_name();
    name.erase(0, std::min(name.size(), name.find_first_not_of('-')));
    name.erase(std::min(name.size(), name.find('=')));
    message = "no flag '" + Printable(dashes + name) + "'." + FlagHint(spec, dashes, name);
  } catch (const po::invalid_command_line_syntax& error) {
    message = error.get_option_name() + (error.kind() == po::invalid_syntax::extra_parameter
                                             ? ": expected no value, found one"
                                             : ": expected a value, found none");
  } catch (const po::error& error) {
    message = error.what();
  }
  throw Failure(code, where + ": " + message);
}

// Takes the first of the words if it is text that begins with dashes, such as an SQL query below a
// comment: no flag has a space after them.
std::vector<po::option> DashedText(Words& words) {
  if (words.empty() || !words.front().starts_with("-- ")) return {};
  po::option text;
  text.value = text.original_tokens = {words.front()};
  words.erase(words.begin());
  return {text};
}

const Flag& ArgumentAt(const CommandSpec& spec, std::size_t position, const std::string& word) {
  // Such a word is a flag to whoever wrote it.
  const bool dashed =
      word.size() > 1 && word[0] == '-' && std::isalpha(static_cast<unsigned char>(word[1])) != 0;
  if (dashed) {
    throw Failure(ExitCode::kUsage, spec.name + ": no flag '" + Printable(word) + "'." +
                                        FlagHint(spec, "--", word.substr(1)));
  }
  if (position < spec.arguments.size()) return spec.arguments[position];
  const bool many =
      !spec.arguments.empty() && spec.arguments.back().value.takes == FlagValue::Takes::kTexts;
  if (many) return spec.arguments.back();
  // Somebody may have forgotten the dashes.
  const std::vector<std::string> names = FlagNames(spec, "");
  const bool known = std::find(names.begin(), names.end(), word) != names.end();
  throw Failure(ExitCode::kUsage, spec.name + ": did not expect the argument '" + Printable(word) +
                                      "'." + (known ? " Did you mean --" + word + "?" : "") +
                                      SeeHelp(spec));
}

}  // namespace

std::vector<Given> ParseWords(const CommandSpec& spec, const Words& words) {
  namespace style = po::command_line_style;
  const po::options_description described = Described(spec);
  const auto options = Parsed(spec, spec.name, ExitCode::kUsage, "--", [&] {
    return po::command_line_parser(words)
        .options(described)
        .style(style::allow_long | style::long_allow_adjacent | style::long_allow_next)
        .extra_style_parser(DashedText)
        .run();
  });
  std::vector<Given> given;
  std::set<const Flag*> seen;
  std::size_t position = 0;
  for (const po::option& option : options) {
    const std::string text = option.value.empty() ? "" : option.value.front();
    const Flag* flag = option.string_key.empty() ? &ArgumentAt(spec, position++, text)
                                                 : spec.Find(option.string_key);
    if (!seen.insert(flag).second && flag->value.takes != FlagValue::Takes::kTexts) {
      throw Failure(ExitCode::kUsage,
                    spec.name + ": --" + flag->name + " is given twice; expected it once");
    }
    given.push_back({flag, text, spec.name, false});
  }
  return given;
}

std::vector<Given> ParseLine(const CommandSpec& spec, const std::string& line,
                             const std::string& where) {
  const po::options_description described = Described(spec);
  std::istringstream stream(line);
  std::vector<Given> given;
  for (const po::option& option : Parsed(spec, where, ExitCode::kBadInput, "", [&] {
         return po::parse_config_file(stream, described);
       })) {
    const std::string text = option.value.empty() ? "" : option.value.front();
    given.push_back({spec.Find(option.string_key), text, where, true});
  }
  return given;
}

}  // namespace dreamsearch
