#include "results/command_line/values.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <system_error>

#include "results/system/error.h"
#include "results/text/names.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// As Boost.ProgramOptions reads a truth value.
bool ParseTruth(const std::string& text) {
  static const std::map<std::string, bool> kWords = {
      {"true", true},   {"yes", true}, {"on", true},   {"1", true},
      {"false", false}, {"no", false}, {"off", false}, {"0", false}};
  std::string lower = text;
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  const auto found = kWords.find(lower);
  if (found == kWords.end()) throw std::invalid_argument("expected true or false");
  return found->second;
}

// A number and the suffix after it.
std::pair<double, std::string> ParseMeasure(const std::string& text, const char* expected) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || !std::isfinite(value) || value < 0) {
    throw std::invalid_argument(expected);
  }
  return {value, std::string(end, text.data() + text.size())};
}

double ParseDuration(const std::string& text) {
  static const std::map<std::string, double> kSeconds = {
      {"", 1}, {"s", 1}, {"m", 60}, {"h", 3600}, {"d", 86400}};
  constexpr char kExpected[] = "expected a duration such as 90, 90s, 30m or 2h";
  const auto [value, suffix] = ParseMeasure(text, kExpected);
  const auto factor = kSeconds.find(suffix);
  if (factor == kSeconds.end()) throw std::invalid_argument(kExpected);
  return value * factor->second;
}

std::uint64_t ParseSize(const std::string& text) {
  static const std::map<std::string, double> kFactors = {
      {"", 1},       {"K", 0x1p10}, {"k", 0x1p10}, {"M", 0x1p20},
      {"m", 0x1p20}, {"G", 0x1p30}, {"g", 0x1p30}, {"T", 0x1p40}};
  constexpr char kExpected[] = "expected a size such as 512M, 4G or a number of bytes";
  const auto [value, suffix] = ParseMeasure(text, kExpected);
  const auto factor = kFactors.find(suffix);
  if (factor == kFactors.end() || value * factor->second > 0x1p62) {
    throw std::invalid_argument(kExpected);
  }
  return static_cast<std::uint64_t>(value * factor->second);
}

std::vector<std::string> ParseNames(const std::string& text) {
  const std::vector<std::string> names = SplitCommas(text);
  std::set<std::string> seen;
  if (names.empty()) throw std::invalid_argument("expected a name, or names with commas between");
  for (const std::string& name : names) {
    if (name.empty()) throw std::invalid_argument("expected a name on each side of a comma");
    if (!seen.insert(name).second) {
      throw std::invalid_argument("expected each name once, and '" + Printable(name) + "' twice");
    }
  }
  return names;
}

}  // namespace

FlagValue Switch(bool* to) {
  return {[to](const Given& given) { *to = !given.from_file || ParseTruth(given.text); },
          FlagValue::Takes::kNothing};
}

FlagValue Text(std::string* to) {
  return Parsed(to, [](const std::string& text) { return text; }).Default(*to);
}

FlagValue Texts(std::vector<std::string>* to) {
  return {[to, of_file = std::ptrdiff_t{0}](const Given& given) mutable {
            to->insert(to->end() - (given.from_file ? 0 : of_file), given.text);
            if (given.from_file) ++of_file;
          },
          FlagValue::Takes::kTexts};
}

FlagValue Names(std::vector<std::string>* to) {
  return Parsed(to, ParseNames).Default(JoinNames(*to));
}

FlagValue Duration(double* seconds) { return Parsed(seconds, ParseDuration); }

FlagValue Size(std::uint64_t* bytes) { return Parsed(bytes, ParseSize); }

FlagValue FlagsFile() {
  return {[](const Given&) {}, FlagValue::Takes::kFlagsFile};
}

std::uint64_t ParseWhole(const std::string& text, std::uint64_t low, std::uint64_t high) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high) {
    const bool bounded = high < std::numeric_limits<std::int64_t>::max();
    throw std::invalid_argument("expected a whole number " +
                                (bounded
                                     ? "from " + std::to_string(low) + " to " + std::to_string(high)
                                     : "of at least " + std::to_string(low) + " and below 2^63"));
  }
  return value;
}

std::string ChoicesText(const std::vector<ChoiceName>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " or " : ", ";
    text += names[i].name;
    if (!names[i].also.empty()) text += " (" + JoinNames(names[i].also) + ")";
  }
  return text;
}

std::size_t ParseChoice(const std::string& text, const std::vector<ChoiceName>& names) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto& [name, also] = names[i];
    if (text == name || std::find(also.begin(), also.end(), text) != also.end()) return i;
    known.push_back(name);
  }
  throw Failure(ExitCode::kUsage, "expected " + ChoicesText(names) + ", found '" + Printable(text) +
                                      "'." + DidYouMean(text, known));
}

FlagValue OneOf(std::string* to, const std::vector<std::string>& names) {
  Choices<std::string> choices;
  for (const std::string& name : names) choices.push_back({name, name});
  return OneOf(to, choices);
}

std::vector<std::string> SplitCommas(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return text.empty() ? std::vector<std::string>{} : parts;
}

}  // namespace dreamsearch
