#include "results/command_line/flags_file.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <system_error>

#include "results/command_line/parser.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::string ReadText(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) {
    throw Failure(ExitCode::kNotFound, file + ": expected a configuration file, found nothing");
  }
  if (std::filesystem::is_directory(file, error)) {
    throw Failure(ExitCode::kBadInput, file + ": expected a configuration file, found a folder");
  }
  constexpr std::uintmax_t kMostBytes = 1 << 20;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Failure(ExitCode::kPermission, file + ": cannot be read: no permission");
  std::string text(kMostBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (stream.bad()) throw Failure(ExitCode::kInputOutput, file + ": cannot be read");
  if (text.size() > kMostBytes) {
    throw Failure(ExitCode::kBadInput,
                  file +
                      ": expected a configuration file with one flag a line, found a file "
                      "larger than 1 MB");
  }
  // A byte order mark means nothing.
  if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);
  return text;
}

}  // namespace

// A line at a time, so that every message can name the line.
std::vector<Given> ReadFlagsFile(const CommandSpec& spec, const std::string& path) {
  const std::string file = AbsolutePath(path);
  std::istringstream lines(ReadText(file));
  std::vector<Given> all;
  std::map<const Flag*, int> first_line;
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
        fail("expected text, found a control character");
      }
    }
    if (!IsUtf8(line)) fail("expected text in UTF-8, found other bytes");
    const std::string content = line.substr(0, line.find('#'));
    const auto begin = content.find_first_not_of(" \t");
    if (begin == std::string::npos) continue;
    const auto equals = content.find('=');
    if (equals == std::string::npos || content[begin] == '[') {
      fail("expected name = value, found '" + content.substr(0, 60) + "'");
    }
    const std::string name =
        content.substr(begin, content.find_last_not_of(" \t", equals - 1) + 1 - begin);
    if (name == "help" || name == "version") fail(name + " is for the command line only");
    for (Given& given : ParseLine(spec, line, where)) {
      const FlagValue::Takes takes = given.flag->value.takes;
      if (takes == FlagValue::Takes::kFlagsFile) fail(name + " is for the command line only");
      if (given.text.empty()) fail(name + ": expected a value, found none");
      const auto [before, added] = first_line.try_emplace(given.flag, number);
      if (!added && takes != FlagValue::Takes::kTexts) {
        fail(name + " is given twice; expected it once. The other is on line " +
             std::to_string(before->second));
      }
      given.file = file;
      all.push_back(std::move(given));
    }
  }
  return all;
}

}  // namespace dreamsearch
