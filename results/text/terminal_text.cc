#include "results/text/terminal_text.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr const char* kBlocks[] = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr const char* kSigns[] = {"_", ".", ":", "-", "=", "+", "*", "#"};
constexpr std::size_t kLevels = 8;

}  // namespace

bool TerminalHasUtf8() {
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* value = std::getenv(name);
    if (value == nullptr || value[0] == '\0') continue;
    std::string text;
    for (const char* c = value; *c != '\0'; ++c) {
      if (*c != '-') text += static_cast<char>(*c >= 'A' && *c <= 'Z' ? *c - 'A' + 'a' : *c);
    }
    return text.find("utf8") != std::string::npos;
  }
  return false;
}

std::string Sparkline(const std::vector<double>& values, double low, double high, bool unicode) {
  std::string line;
  for (const double value : values) {
    if (!std::isfinite(value)) {
      line += ' ';
      continue;
    }
    const double share = high > low ? (value - low) / (high - low) : 0.5;
    const auto level = static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * (kLevels - 0.01));
    line += unicode ? kBlocks[level] : kSigns[level];
  }
  return line;
}

std::vector<double> MeansOfColumns(const std::vector<double>& values, std::size_t columns) {
  const std::size_t count = std::min(columns, values.size());
  std::vector<double> means;
  for (std::size_t column = 0; column < count; ++column) {
    double sum = 0, finite = 0;
    const std::size_t end = (column + 1) * values.size() / count;
    for (std::size_t i = column * values.size() / count; i < end; ++i) {
      if (!std::isfinite(values[i])) continue;
      sum += values[i];
      ++finite;
    }
    means.push_back(finite > 0 ? sum / finite : std::numeric_limits<double>::quiet_NaN());
  }
  return means;
}

std::string OneLine(const std::string& text, std::size_t width) {
  std::string line;
  std::size_t characters = 0;
  for (const char c : Printable(text)) {
    const bool continues = (static_cast<unsigned char>(c) & 0xc0) == 0x80;
    if (!continues && ++characters > width) break;
    line += c;
  }
  return line;
}

}  // namespace dreamsearch
