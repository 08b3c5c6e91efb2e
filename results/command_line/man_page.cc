#include "results/command_line/man_page.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <utility>
#include <vector>

#include "results/command_line/help.h"
#include "results/system/error.h"
#include "results/system/file.h"

namespace dreamsearch {
namespace {

// Text that means itself: groff takes some ASCII characters for others when it prints, a
// backslash for an escape, and a period or an apostrophe at the beginning of a line for a
// request.
std::string Literal(const std::string& text) {
  std::string literal = text.starts_with('.') || text.starts_with('\'') ? "\\&" : "";
  for (const char letter : text) {
    switch (letter) {
      case '\\':
        literal += "\\e";
        break;
      case '-':
        literal += "\\-";
        break;
      case '\'':
        literal += "\\(aq";
        break;
      case '`':
        literal += "\\(ga";
        break;
      case '^':
        literal += "\\(ha";
        break;
      case '~':
        literal += "\\(ti";
        break;
      default:
        literal += letter;
    }
  }
  return literal;
}

std::string Heading(const std::string& heading) {
  std::string upper = heading;
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::toupper(letter)); });
  return ".SH \"" + Literal(upper) + "\"\n";
}

std::string Section(const HelpPart& part) {
  std::string text;
  if (!part.lines.empty()) {
    text += Heading(part.heading == kUsageHeading ? "Synopsis" : part.heading) + ".nf\n";
    for (const std::string& line : part.lines) text += Literal(line) + "\n";
    text += ".fi\n";
  }
  if (!part.paragraphs.empty()) text += Heading("Description");
  for (std::size_t i = 0; i < part.paragraphs.size(); ++i) {
    text += (i == 0 ? "" : ".PP\n") + Literal(part.paragraphs[i]) + "\n";
  }
  if (!part.rows.empty()) text += Heading(part.heading);
  for (const auto& [name, meaning] : part.rows) {
    text += ".TP\n\\fB" + Literal(name) + "\\fR\n" + Literal(meaning) + "\n";
  }
  return text;
}

// "runner-eval" of "runner eval".
std::string PageName(std::string command) {
  std::replace(command.begin(), command.end(), ' ', '-');
  return command;
}

std::string Page(const Program& program, const CommandSpec& spec, std::vector<HelpPart> parts,
                 const std::vector<std::string>& see_also) {
  // In a manual the examples come last.
  std::stable_partition(parts.begin(), parts.end(),
                        [](const HelpPart& part) { return part.heading != kExamplesHeading; });
  const std::string name = PageName(spec.name);
  std::string text = ".TH \"" + Literal(name) + "\" 1 \"\" \"" + Literal(program.version) +
                     "\" \"User Commands\"\n" + Heading("Name") + Literal(name) + " \\- " +
                     Literal(spec.summary) + "\n";
  for (const HelpPart& part : parts) text += Section(part);
  text += Heading("See also");
  for (std::size_t i = 0; i < see_also.size(); ++i) {
    text += ".BR " + Literal(see_also[i]) + " (1)" + (i + 1 < see_also.size() ? "," : "") + "\n";
  }
  return text;
}

}  // namespace

std::string ManPage(const Program& program) {
  std::vector<std::string> others;
  for (const Command& command : program.commands) others.push_back(PageName(command.spec.name));
  return Page(program, program.root.spec, ProgramHelpParts(program), others);
}

std::string ManPage(const Program& program, const Command& command) {
  return Page(program, command.spec, HelpParts(command.spec), {PageName(program.root.spec.name)});
}

void WriteManPages(const Program& program, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw Failure(ExitCode::kCannotCreate, folder + " cannot be created: " + error.message());
  }
  const auto write = [&](const CommandSpec& spec, const std::string& page) {
    WriteWholeFile(folder + "/" + PageName(spec.name) + ".1", page);
  };
  write(program.root.spec, ManPage(program));
  for (const Command& command : program.commands) write(command.spec, ManPage(program, command));
}

}  // namespace dreamsearch
