// values.h - the kinds of values that a flag can have.
//
// Each stores what was given where the pointer says, and takes the default that the help
// shows from what is there before, where it has a text: Duration, Size, Parsed and lists
// say theirs with .Default("...").
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "results/command_line/command.h"

namespace dreamsearch {

// A flag without a value. In a file: yes or no, true or false, on or off, 1 or 0.
FlagValue Switch(bool* to);

FlagValue Text(std::string* to);
// A text each time the flag is given; those of the command line before those of a file.
FlagValue Texts(std::vector<std::string>* to);

// "a,b": names that are not empty and differ.
FlagValue Names(std::vector<std::string>* to);

// 90, 90s, 30m, 2h or 1d; 0 and more.
FlagValue Duration(double* seconds);
// A number of bytes, or 512K, 512M, 4G, 1T, in powers of 1024.
FlagValue Size(std::uint64_t* bytes);

// The path of a file with more flags.
FlagValue FlagsFile();

// What `parse` makes of the text; it throws as FlagValue::read.
template <typename T, typename Parse>
FlagValue Parsed(T* to, Parse parse) {
  return {[to, parse](const Given& given) { *to = parse(given.text); }};
}

// What `parse` makes of each text between commas, also of several times the flag. Empty
// texts are nothing.
template <typename T, typename Parse>
FlagValue ListOf(std::vector<T>* to, Parse parse);
inline FlagValue ListOf(std::vector<std::string>* to) {
  return ListOf(to, [](const std::string& text) { return text; });
}

// A whole number from `low` to `high`.
std::uint64_t ParseWhole(const std::string& text, std::uint64_t low, std::uint64_t high);
template <typename T>
FlagValue Whole(T* to, std::uint64_t low,
                std::uint64_t high = static_cast<std::uint64_t>(std::numeric_limits<T>::max())) {
  return Parsed(to,
                [low, high](const std::string& text) {
                  return static_cast<T>(ParseWhole(text, low, high));
                })
      .Default(std::to_string(*to));
}

// One of a few names, some of which have others that mean the same.
template <typename T>
struct Choice {
  std::string name;
  T value;
  std::vector<std::string> also = {};
};
struct ChoiceName {
  std::string name;
  std::vector<std::string> also = {};
};
// "steps, seconds (s) or transitions".
std::string ChoicesText(const std::vector<ChoiceName>& names);
// The place of the text among the names; Failure 2 with what was expected, and is near.
std::size_t ParseChoice(const std::string& text, const std::vector<ChoiceName>& names);
template <typename T>
using Choices = std::vector<Choice<T>>;
// *to is a T or a std::optional<T>.
template <typename To, typename T>
FlagValue OneOf(To* to, const Choices<T>& choices);
// The name is the value.
FlagValue OneOf(std::string* to, const std::vector<std::string>& names);

// --- how ---------------------------------------------------------------------

std::vector<std::string> SplitCommas(const std::string& text);

template <typename T, typename Parse>
FlagValue ListOf(std::vector<T>* to, Parse parse) {
  return {[to, parse](const Given& given) {
            for (const std::string& part : SplitCommas(given.text)) {
              if (!part.empty()) to->push_back(parse(part));
            }
          },
          FlagValue::Takes::kTexts};
}

template <typename To, typename T>
FlagValue OneOf(To* to, const Choices<T>& choices) {
  std::vector<ChoiceName> names;
  std::vector<T> values;
  std::string default_text;
  for (const Choice<T>& choice : choices) {
    names.push_back({choice.name, choice.also});
    values.push_back(choice.value);
    if (*to == choice.value) default_text = choice.name;
  }
  FlagValue value = Parsed(
      to, [names, values](const std::string& text) { return values[ParseChoice(text, names)]; });
  value.choices = ChoicesText(names);
  value.default_text = default_text;
  return value;
}

}  // namespace dreamsearch
