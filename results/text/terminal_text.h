// terminal_text.h - lines for a terminal of a given width.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace dreamsearch {

// Whether the language of the environment says that text is UTF-8.
bool TerminalHasUtf8();

// A curve of one character a value, from `low` to `high`; a value that is not finite is a blank.
// In blocks of Unicode, or in ASCII.
std::string Sparkline(const std::vector<double>& values, double low, double high, bool unicode);

// The values in at most `columns` of equal numbers of values: the mean of each.
std::vector<double> MeansOfColumns(const std::vector<double>& values, std::size_t columns);

// At most `width` characters of the text. What could steer the terminal is written out, as
// Printable does.
std::string OneLine(const std::string& text, std::size_t width);

}  // namespace dreamsearch
