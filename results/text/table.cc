#include "results/text/table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <set>

#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

std::string ExactCell(const Cell& cell) {
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return std::to_string(*whole);
  if (const auto* real = std::get_if<double>(&cell)) {
    return std::isfinite(*real) ? ExactText(*real) : "";
  }
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  return "";
}

nlohmann::ordered_json ToJson(const std::vector<std::string>& columns,
                              const std::vector<Cell>& row) {
  nlohmann::ordered_json object = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    auto& field = object[columns[i]];
    if (const auto* whole = std::get_if<std::int64_t>(&row[i])) field = *whole;
    if (const auto* real = std::get_if<double>(&row[i]); real && std::isfinite(*real)) {
      field = *real;
    }
    if (const auto* text = std::get_if<std::string>(&row[i])) field = *text;
  }
  return object;
}

std::string RoundedCell(const Cell& cell) {
  const auto* real = std::get_if<double>(&cell);
  if (real == nullptr) return Printable(ExactCell(cell));
  if (!std::isfinite(*real)) return "";
  return FormatNumber("%.6g", *real);
}

std::string MarkdownCell(const Cell& cell) {
  std::string escaped;
  for (const char c : RoundedCell(cell)) {
    if (c == '|' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

}  // namespace

bool IsNumber(const Cell& cell) {
  return std::holds_alternative<std::int64_t>(cell) || std::holds_alternative<double>(cell);
}

void CheckNamesDiffer(const std::vector<std::string>& columns) {
  std::set<std::string> names;
  for (const std::string& name : columns) {
    if (names.insert(name).second) continue;
    throw Failure(ExitCode::kUsage,
                  "two columns are called '" + Printable(name) +
                      "', and JSON can keep only one of them. Give each a name of its own in the "
                      "query: SELECT a." +
                      Printable(name) + " AS first, b." + Printable(name) +
                      " AS second. The forms text, markdown and csv print both.");
  }
}

std::string Table::Print(TableForm form, std::size_t indent) const {
  std::string out;
  if (form == TableForm::kJson) {
    CheckNamesDiffer(columns);
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const std::vector<Cell>& row : rows) list.push_back(ToJson(columns, row));
    return JsonTextReplacing(list, 2) + "\n";
  }
  if (form == TableForm::kCsv) {
    out = CsvLine({columns.begin(), columns.end()});
    for (const std::vector<Cell>& row : rows) out += CsvLine(row);
    return out;
  }

  const bool markdown = form == TableForm::kMarkdown;
  std::size_t count = columns.size();
  for (const std::vector<Cell>& row : rows) count = std::max(count, row.size());
  std::vector<bool> right(count, !rows.empty());
  std::vector<std::vector<std::string>> cells = {columns};
  for (const std::vector<Cell>& row : rows) {
    cells.emplace_back();
    for (std::size_t i = 0; i < row.size(); ++i) {
      cells.back().push_back(markdown ? MarkdownCell(row[i]) : RoundedCell(row[i]));
      const bool empty = std::holds_alternative<std::monostate>(row[i]);
      if (!IsNumber(row[i]) && !empty) right[i] = false;
    }
  }
  std::vector<std::size_t> widths(count, markdown ? 3 : 0);
  for (auto& row : cells) {
    row.resize(count);
    for (std::size_t i = 0; i < count; ++i) widths[i] = std::max(widths[i], Width(row[i]));
  }
  for (std::size_t r = columns.empty() && !markdown ? 1 : 0; r < cells.size(); ++r) {
    std::string line = markdown ? "|" : std::string(indent, ' ');
    for (std::size_t i = 0; i < count; ++i) {
      const std::string padding(widths[i] - Width(cells[r][i]), ' ');
      line += markdown ? " " : i > 0 ? "  " : "";
      line += right[i] ? padding + cells[r][i] : cells[r][i] + padding;
      if (markdown) line += " |";
    }
    while (!markdown && !line.empty() && line.back() == ' ') line.pop_back();
    out += line + "\n";
    if (markdown && r == 0) {
      out += "|";
      for (std::size_t i = 0; i < count; ++i) {
        out += " " + std::string(widths[i] - 1, '-') + (right[i] ? ":" : "-") + " |";
      }
      out += "\n";
    }
    const auto note = r == 0 ? notes.end() : notes.find(r - 1);
    if (!markdown && note != notes.end()) out += note->second + "\n";
  }
  return out;
}

std::string JsonLine(const std::vector<std::string>& columns, const std::vector<Cell>& row) {
  return JsonTextReplacing(ToJson(columns, row)) + "\n";
}

namespace {

// A spreadsheet computes what begins so, also a stranger's text: it is written with the sign that
// says that it is text. A number stays what it is.
std::string CsvCell(const Cell& cell) {
  const std::string text = ExactCell(cell);
  if (IsNumber(cell) || text.empty() || std::strchr("=+-@\t\r", text[0]) == nullptr) return text;
  double number = 0;
  const char* end = text.data() + text.size();
  const char* begin = text.data() + (text[0] == '+' ? 1 : 0);
  if (std::from_chars(begin, end, number).ptr == end && begin != end) return text;
  return "'" + text;
}

}  // namespace

std::string CsvLine(const std::vector<Cell>& row) {
  std::string line;
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (i > 0) line += ',';
    line += CsvField(CsvCell(row[i]));
  }
  return line + "\n";
}

}  // namespace dreamsearch::results
