// text.h - numbers and names as people and other programs read them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace dreamsearch {

// The shortest decimal text that reads back as the same number.
std::string ExactText(double value);
// A number in printf's format: ("%.1f", 2.25) is "2.2".
std::string FormatNumber(const char* format, double value);
// A field of a CSV file, quoted where RFC 4180 asks for it.
std::string CsvField(const std::string& text);
// Control characters as \n, \t or \x1b, those of Unicode as a question mark, so that a name
// cannot steer a terminal.
std::string Printable(const std::string& text);
// The same line by line: the newlines stay.
std::string PrintableLines(const std::string& text);
// Characters of UTF-8.
std::size_t Width(const std::string& text);

// `text` broken at spaces into lines of at most `width` characters, each after
// `indent` spaces, joined by newlines. A longer word has a line of its own.
std::string WrapText(const std::string& text, std::size_t width, std::size_t indent);

// "1,234,567".
std::string GroupDigits(std::int64_t number);
// "1 run", "1,234 runs".
std::string Counted(std::uint64_t number, const std::string& noun);
// "45 s", "12 min", "3 h 20 min", "2 d 4 h".
std::string FormatDuration(double seconds);
// "812 B", "3.4 MB".
std::string FormatBytes(double bytes);

}  // namespace dreamsearch
