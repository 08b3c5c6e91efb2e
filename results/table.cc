#include "results/table.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "results/error.h"
#include "results/sqlite.h"

namespace dreamsearch::results {
namespace {

bool IsNumber(const Cell& cell) {
  return std::holds_alternative<std::int64_t>(cell) || std::holds_alternative<double>(cell);
}

std::string ExactCell(const Cell& cell) {
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return std::to_string(*whole);
  if (const auto* real = std::get_if<double>(&cell)) {
    return std::isfinite(*real) ? ExactText(*real) : "";
  }
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  return "";
}

std::string RoundedCell(const Cell& cell) {
  const auto* real = std::get_if<double>(&cell);
  if (real == nullptr) return Printable(ExactCell(cell));
  if (!std::isfinite(*real)) return "";
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", *real);
  return text;
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

TableForm ParseTableForm(const std::string& name) {
  if (name == "text") return TableForm::kText;
  if (name == "markdown") return TableForm::kMarkdown;
  if (name == "csv") return TableForm::kCsv;
  if (name == "json") return TableForm::kJson;
  throw Error(kExitUsage, "no table format '" + name + "'. Known: text, markdown, csv, json");
}

std::string ExactText(double value) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof text, value);
  return {text, end.ptr};
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + "\"";
}

std::string Printable(const std::string& text) {
  std::string shown;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '\n') {
      shown += "\\n";
    } else if (c == '\t') {
      shown += "\\t";
    } else if (byte < 0x20 || byte == 0x7f) {
      char escaped[8];
      std::snprintf(escaped, sizeof escaped, "\\x%02x", byte);
      shown += escaped;
    } else {
      shown += c;
    }
  }
  return shown;
}

std::string Grouped(std::int64_t value) {
  std::string digits = std::to_string(value);
  for (auto i = static_cast<std::int64_t>(digits.size()) - 3; i > (value < 0 ? 1 : 0); i -= 3) {
    digits.insert(static_cast<std::size_t>(i), ",");
  }
  return digits;
}

std::size_t Width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string Table::Print(TableForm form) const {
  std::string out;
  if (form == TableForm::kJson) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const std::vector<Cell>& row : rows) {
      nlohmann::ordered_json object = nlohmann::ordered_json::object();
      for (std::size_t i = 0; i < columns.size(); ++i) {
        auto& field = object[columns[i]];
        if (const auto* whole = std::get_if<std::int64_t>(&row[i])) field = *whole;
        if (const auto* real = std::get_if<double>(&row[i]); real && std::isfinite(*real)) {
          field = *real;
        }
        if (const auto* text = std::get_if<std::string>(&row[i])) field = *text;
      }
      list.push_back(std::move(object));
    }
    return list.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  }
  if (form == TableForm::kCsv) {
    for (std::size_t i = 0; i < columns.size(); ++i) out += (i > 0 ? "," : "") + CsvField(columns[i]);
    out += "\n";
    for (const std::vector<Cell>& row : rows) {
      for (std::size_t i = 0; i < row.size(); ++i) {
        if (i > 0) out += ',';
        out += CsvField(ExactCell(row[i]));
      }
      out += "\n";
    }
    return out;
  }

  const bool markdown = form == TableForm::kMarkdown;
  std::vector<std::vector<std::string>> cells = {columns};
  std::vector<bool> right(columns.size(), !rows.empty());
  for (const std::vector<Cell>& row : rows) {
    cells.emplace_back();
    for (std::size_t i = 0; i < row.size(); ++i) {
      cells.back().push_back(markdown ? MarkdownCell(row[i]) : RoundedCell(row[i]));
      const bool empty = std::holds_alternative<std::monostate>(row[i]);
      if (!IsNumber(row[i]) && !empty) right[i] = false;
    }
  }
  std::vector<std::size_t> widths(columns.size(), markdown ? 3 : 0);
  for (const auto& row : cells) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], Width(row[i]));
  }
  for (std::size_t r = 0; r < cells.size(); ++r) {
    std::string line = markdown ? "|" : "";
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const std::string padding(widths[i] - Width(cells[r][i]), ' ');
      line += markdown ? " " : i > 0 ? "  " : "";
      line += right[i] ? padding + cells[r][i] : cells[r][i] + padding;
      if (markdown) line += " |";
    }
    while (!markdown && !line.empty() && line.back() == ' ') line.pop_back();
    out += line + "\n";
    if (markdown && r == 0) {
      out += "|";
      for (std::size_t i = 0; i < columns.size(); ++i) {
        out += " " + std::string(widths[i] - 1, '-') + (right[i] ? ":" : "-") + " |";
      }
      out += "\n";
    }
  }
  return out;
}

Table ReadTable(Statement* statement) {
  Table table;
  for (int i = 0; i < statement->columns(); ++i) table.columns.push_back(statement->ColumnName(i));
  while (statement->Step()) {
    std::vector<Cell>& row = table.rows.emplace_back();
    for (int i = 0; i < statement->columns(); ++i) {
      if (statement->IsNull(i)) {
        row.emplace_back();
      } else if (statement->IsInt(i)) {
        row.emplace_back(statement->Int(i));
      } else if (statement->IsReal(i)) {
        row.emplace_back(statement->Real(i));
      } else {
        row.emplace_back(statement->Text(i));
      }
    }
  }
  return table;
}

void WriteFile(const std::string& path, const std::string& bytes) {
  const std::string absolute = AbsolutePath(path);
  const std::string temporary = absolute + ".part" + std::to_string(getpid());
  const auto fail = [&](const std::string& what) {
    const int error = errno;
    unlink(temporary.c_str());
    const int exit_code = error == EACCES || error == EPERM || error == EROFS ? kExitPermission
                          : error == ENOSPC || error == EIO || error == EDQUOT
                              ? kExitInputOutput
                              : kExitCannotCreate;
    throw Error(exit_code, absolute + ": cannot be " + what + ": " + std::strerror(error));
  };
  const int file = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) fail("created");
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = write(file, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      const int error = errno;
      close(file);
      errno = error;
      fail("written");
    }
    done += static_cast<std::size_t>(n);
  }
  if (close(file) != 0) fail("written");
  if (rename(temporary.c_str(), absolute.c_str()) != 0) fail("put in place");
}

}  // namespace dreamsearch::results
