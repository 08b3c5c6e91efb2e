#include "results/figures/table.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "results/system/error.h"
#include "results/system/json_text.h"
#include "results/database/sqlite.h"

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

// Where a path ends when its symbolic links are followed; nothing need be there.
std::string FinalTarget(std::filesystem::path path) {
  std::error_code error;
  while (std::filesystem::is_symlink(path, error)) {
    path = path.parent_path() / std::filesystem::read_symlink(path, error);
  }
  return path.string();
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
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  }));
}

std::string Table::Print(TableForm form) const {
  std::string out;
  if (form == TableForm::kJson) {
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

std::vector<Cell> ReadCells(const Statement& statement) {
  std::vector<Cell> row;
  for (int i = 0; i < statement.columns(); ++i) {
    if (statement.IsNull(i)) {
      row.emplace_back();
    } else if (statement.IsInt(i)) {
      row.emplace_back(statement.Int(i));
    } else if (statement.IsReal(i)) {
      row.emplace_back(statement.Real(i));
    } else {
      row.emplace_back(statement.Text(i));
    }
  }
  return row;
}

Table ReadTable(Statement* statement) {
  Table table;
  for (int i = 0; i < statement->columns(); ++i) table.columns.push_back(statement->ColumnName(i));
  while (statement->Step()) table.rows.push_back(ReadCells(*statement));
  return table;
}

OutputFile::OutputFile(const std::string& path) : path_(AbsolutePath(path)) {
  struct stat there;
  const bool exists = stat(path_.c_str(), &there) == 0;
  if (!exists && errno == ELOOP) Fail("created");
  if (exists && !S_ISREG(there.st_mode)) {
    file_ = open(path_.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
    if (file_ < 0) Fail("written");
    return;
  }
  path_ = FinalTarget(path_);
  temporary_ = path_ + ".part" + std::to_string(getpid());
  file_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file_ < 0) Fail("created");
}

OutputFile::~OutputFile() {
  if (file_ < 0) return;
  close(file_);
  RemoveTemporary();
}

void OutputFile::RemoveTemporary() {
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

void OutputFile::Fail(const char* what) {
  const int error = errno;
  if (file_ >= 0) close(file_);
  file_ = -1;
  RemoveTemporary();
  const int exit_code = error == EACCES || error == EPERM || error == EROFS  ? kExitPermission
                        : error == ENOSPC || error == EIO || error == EDQUOT ? kExitInputOutput
                                                                             : kExitCannotCreate;
  throw Error(exit_code, path_ + ": cannot be " + what + ": " + std::strerror(error));
}

void OutputFile::Append(const std::string& bytes) {
  buffer_ += bytes;
  if (buffer_.size() >= (1 << 20)) Flush();
}

void OutputFile::Flush() {
  std::size_t done = 0;
  while (done < buffer_.size()) {
    const ssize_t n = write(file_, buffer_.data() + done, buffer_.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) Fail("written");
    done += static_cast<std::size_t>(n);
  }
  buffer_.clear();
}

void OutputFile::Close() {
  Flush();
  if (!temporary_.empty() && fsync(file_) != 0) Fail("written");
  const int file = std::exchange(file_, -1);
  if (close(file) != 0) Fail("written");
  if (!temporary_.empty() && rename(temporary_.c_str(), path_.c_str()) != 0) Fail("put in place");
}

void WriteFile(const std::string& path, const std::string& bytes) {
  OutputFile file(path);
  file.Append(bytes);
  file.Close();
}

std::string ReadWholeFile(const std::string& path) {
  const std::string absolute = AbsolutePath(path);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(absolute.c_str(), "rb"),
                                                             std::fclose);
  const auto fail = [&absolute](int error) {
    throw Error(error == EACCES   ? kExitPermission
                : error == ENOENT ? kExitNoInput
                                  : kExitInputOutput,
                absolute + ": cannot be read: " + std::strerror(error));
  };
  if (file == nullptr) fail(errno);
  std::string bytes;
  char buffer[1 << 16];
  std::size_t size;
  while ((size = std::fread(buffer, 1, sizeof buffer, file.get())) > 0) bytes.append(buffer, size);
  if (std::ferror(file.get()) != 0) fail(errno);
  return bytes;
}

std::string JsonLine(const std::vector<std::string>& columns, const std::vector<Cell>& row) {
  return JsonTextReplacing(ToJson(columns, row)) + "\n";
}

std::string CsvLine(const std::vector<Cell>& row) {
  std::string line;
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (i > 0) line += ',';
    line += CsvField(ExactCell(row[i]));
  }
  return line + "\n";
}

}  // namespace dreamsearch::results
