#include "results/command_line/command.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "results/command_line/flags_file.h"
#include "results/command_line/parser.h"
#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

ExitCode CodeOf(const Given& given) {
  return given.from_file ? ExitCode::kBadInput : ExitCode::kUsage;
}

std::string Shortened(const std::string& text) {
  constexpr std::size_t kMost = 60;
  return text.size() > kMost ? Printable(text.substr(0, kMost)) + "..." : Printable(text);
}

void Bind(const Given& given) {
  try {
    given.flag->value.read(given);
  } catch (const std::invalid_argument& error) {
    throw Failure(CodeOf(given),
                  given.Where() + ": " + error.what() + ", found " +
                      (given.text.empty() ? "nothing" : "'" + Shortened(given.text) + "'"));
  } catch (const Failure& error) {
    throw Failure(CodeOf(given), given.Where() + ": " + error.what());
  }
}

void CheckExclusive(const CommandSpec& spec, const std::vector<Given>& given) {
  const auto find = [&](const std::string& name) {
    return std::find_if(given.begin(), given.end(),
                        [&](const Given& one) { return one.flag->name == name; });
  };
  for (const auto& [one, other] : spec.exclusive) {
    const auto first = find(one), second = find(other);
    if (first == given.end() || second == given.end()) continue;
    const bool file = first->from_file;
    const std::string dashes = file ? "" : "--";
    const Given& earlier = first < second ? *first : *second;
    const Given& later = first < second ? *second : *first;
    throw Failure(CodeOf(later), later.where + ": expected " + dashes + one + " or " + dashes +
                                     other + ", found both" +
                                     (file ? "; the other is in " + earlier.where : ""));
  }
}

void CheckRequired(const CommandSpec& spec, const std::vector<Given>& given) {
  const auto check = [&](const Flag& flag) {
    const bool there = std::any_of(given.begin(), given.end(),
                                   [&](const Given& one) { return one.flag == &flag; });
    if (there || !flag.value.required) return;
    const std::string shown =
        flag.is_argument() ? flag.value_name : "--" + flag.name + " " + flag.value_name;
    throw Failure(ExitCode::kUsage, spec.name + ": expected " + shown + " (" + flag.help +
                                        "), found none. Example: " + spec.examples.front());
  };
  for (const Flag& flag : spec.arguments) check(flag);
  for (const FlagGroup& group : spec.groups) {
    for (const Flag& flag : group.flags) check(flag);
  }
}

}  // namespace

std::string Given::Where() const {
  const std::string shown = flag->is_argument() ? flag->value_name : flag->name;
  return where + ": " + (flag->is_argument() || from_file ? "" : "--") + shown;
}

const Flag* CommandSpec::Find(const std::string& name_of_flag) const {
  for (const FlagGroup& group : groups) {
    for (const Flag& flag : group.flags) {
      if (flag.name == name_of_flag) return &flag;
    }
  }
  return nullptr;
}

void ReadCommandLine(const CommandSpec& spec, const Words& words) {
  const std::vector<Given> written = ParseWords(spec, words);
  CheckExclusive(spec, written);
  // What is read later wins.
  std::vector<Given> given;
  for (const Given& one : written) {
    if (one.flag->value.takes != FlagValue::Takes::kFlagsFile) continue;
    given = ReadFlagsFile(spec, one.text);
    CheckExclusive(spec, given);
  }
  given.insert(given.end(), written.begin(), written.end());
  for (const Given& one : given) Bind(one);
  CheckRequired(spec, given);
}

}  // namespace dreamsearch
