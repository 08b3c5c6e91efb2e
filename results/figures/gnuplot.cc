#include "results/figures/gnuplot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

#include "results/system/child.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/temporary_folder.h"

namespace dreamsearch::results {
namespace {

// Empty if there is none.
std::string TextOf(const std::string& path) {
  return std::filesystem::exists(path) ? ReadWholeFile(path) : "";
}

// Runs a program in a folder; what it prints goes to the file `output` there. The
// wait status, or -1 with errno if it cannot be started.
int Run(const char* const* arguments, const std::string& folder, const char* output) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, output, O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  pid_t child = 0;
  const int error = posix_spawnp(&child, arguments[0], &actions, nullptr,
                                 const_cast<char* const*>(arguments), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    errno = error;
    return -1;
  }
  return WaitForEnd(child);
}

// The letter of UTF-8 at `*at`, which moves past it; 0 where there is none.
char32_t NextLetter(const std::string& text, std::size_t* at) {
  const auto first = static_cast<unsigned char>(text[(*at)++]);
  if (first < 0x80) return first;
  const int more = first >= 0xf0 && first < 0xf8   ? 3
                   : first >= 0xe0 && first < 0xf0 ? 2
                   : first >= 0xc2 && first < 0xe0 ? 1
                                                   : 0;
  if (more == 0) return 0;
  char32_t letter = first & (0x3f >> more);
  for (int i = 0; i < more; ++i) {
    if (*at >= text.size() || (static_cast<unsigned char>(text[*at]) & 0xc0) != 0x80) return 0;
    letter = letter << 6 | (static_cast<unsigned char>(text[(*at)++]) & 0x3f);
  }
  return letter;
}

// Ranges of letters that some font has. Pango uses fonts of these two formats.
std::vector<std::pair<unsigned long, unsigned long>> LettersOfFonts(const std::string& folder) {
  const char* arguments[] = {"fc-list", "-f", "%{fontformat} %{charset}\n", nullptr};
  std::vector<std::pair<unsigned long, unsigned long>> ranges = {{0, 0x7f}};
  if (Run(arguments, folder, "fonts") != 0) return ranges;
  std::istringstream lines(TextOf(folder + "/fonts"));
  std::string line, format, range;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    words >> format;
    if (format != "TrueType" && format != "CFF") continue;
    while (words >> range) {
      char* end = nullptr;
      const unsigned long low = std::strtoul(range.c_str(), &end, 16);
      ranges.emplace_back(low, *end == '-' ? std::strtoul(end + 1, nullptr, 16) : low);
    }
  }
  return ranges;
}

// A letter that no font has comes out of gnuplot's cairo terminals as a box larger
// than the picture; the sign for such a letter takes its place.
std::string Drawable(const std::string& script, const std::string& folder) {
  const auto ascii = [](char c) { return static_cast<unsigned char>(c) < 0x80; };
  if (std::all_of(script.begin(), script.end(), ascii)) return script;
  const auto ranges = LettersOfFonts(folder);
  const auto known = [&ranges](char32_t letter) {
    return std::any_of(ranges.begin(), ranges.end(), [letter](const auto& range) {
      return range.first <= letter && letter <= range.second;
    });
  };
  std::string text;
  for (std::size_t at = 0; at < script.size();) {
    const std::size_t begin = at;
    const char32_t letter = NextLetter(script, &at);
    if (letter != 0 && (letter < 0x80 || known(letter))) {
      text.append(script, begin, at - begin);
    } else {
      text += known(0xfffd) ? "\xEF\xBF\xBD" : "?";
    }
  }
  return text;
}

}  // namespace

std::string RunGnuplot(const std::string& script, bool with_fonts) {
  const TemporaryFolder temporary;
  const std::string folder = temporary.path().string();
  std::ofstream(folder + "/script") << (with_fonts ? Drawable(script, folder) : script);

  // -d: the user's own settings file would change the picture.
  const char* arguments[] = {"gnuplot", "-d", "script", nullptr};
  const int status = Run(arguments, folder, "messages");
  if (status == -1) {
    throw Failure(ExitCode::kNotFound,
                  std::string("gnuplot, which draws the pictures, cannot be started: ") +
                      std::strerror(errno) + ". Install the package gnuplot-nox.");
  }
  std::string bytes = TextOf(folder + "/figure");
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || bytes.empty()) {
    throw Failure(ExitCode::kInternal, "gnuplot drew no picture: " + TextOf(folder + "/messages"));
  }
  return bytes;
}

// Its <title> would show when hovering.
std::string WithoutEmptyGroups(const std::string& svg) {
  std::string kept;
  std::size_t at = 0;
  while (at < svg.size()) {
    const std::size_t end = std::min(svg.find('\n', at), svg.size() - 1) + 1;
    if (svg.compare(at, 9, "<g fill=\"") == 0 && svg.compare(end, 5, "</g>\n") == 0 &&
        svg[end - 2] == '>') {
      at = end + 5;
      continue;
    }
    if (svg.compare(at, end - at, "<title>Gnuplot</title>\n") != 0) kept.append(svg, at, end - at);
    at = end;
  }
  return kept;
}

}  // namespace dreamsearch::results
