#include "host/commands/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "host/acting/activity_clock.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::size_t TerminalWidth() {
  winsize size{};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 100;
}

}  // namespace

ProgressDisplay::ProgressDisplay() : terminal_(::isatty(STDERR_FILENO) != 0) {
  const char* no_colour = std::getenv("NO_COLOR");
  const char* term = std::getenv("TERM");
  const bool dumb = term == nullptr || std::string(term) == "dumb";
  if (dumb) terminal_ = false;
  colour_ = terminal_ && (no_colour == nullptr || no_colour[0] == '\0');
}

ProgressDisplay::~ProgressDisplay() { Erase(); }

void ProgressDisplay::Erase() {
  for (; drawn_ > 0; --drawn_) std::cerr << "\033[A\033[2K";
  std::cerr << std::flush;
}

std::string ProgressDisplay::Format(const ActiveLine& line) const {
  const RunProgress& progress = line.progress;
  const auto target = static_cast<double>(line.env_steps_target);
  const auto made = static_cast<double>(progress.env_step);
  std::string text =
      line.label + "  " + FormatNumber("%3.0f%%", target > 0 ? 100 * made / target : 0) + "  " +
      GroupDigits(progress.env_step) + " of " + GroupDigits(line.env_steps_target) + " steps";
  if (line.rate > 0) text += "  " + FormatNumber("%.0f steps/s", line.rate);
  if (std::isfinite(progress.training_return)) {
    text += "  return " + FormatNumber("%.1f", progress.training_return);
  }
  if (std::isfinite(progress.evaluation_return)) {
    text += "  evaluated " + FormatNumber("%.1f", progress.evaluation_return);
  }
  if (line.rate > 0 && made < target) {
    text += "  " + FormatDuration((target - made) / line.rate) + " left";
  }
  if (line.threads > 1) text += "  " + Counted(line.threads, "thread");
  const std::string stage = progress.lock_wait_seconds > 0
                                ? "waiting " + FormatDuration(progress.lock_wait_seconds) +
                                      " for another process to unlock the database"
                                : RunStageName(progress.stage);
  return text + "  (" + stage + ")";
}

void ProgressDisplay::Show(const std::map<std::size_t, ActiveLine>& lines,
                           const std::string& summary) {
  if (!terminal_) {
    const double now = ActivityClock::Now();
    for (const auto& [run, line] : lines) {
      const auto [last, first] = last_printed_.try_emplace(run, now);
      if (first || now - last->second < 30) continue;
      last->second = now;
      std::cerr << Format(line) << std::endl;
    }
    return;
  }
  Erase();
  const std::size_t width = TerminalWidth() - 1;
  for (const auto& [run, line] : lines) {
    std::cerr << Format(line).substr(0, width) << "\n";
    ++drawn_;
  }
  std::cerr << (colour_ ? "\033[1m" : "") << summary.substr(0, width) << (colour_ ? "\033[0m" : "")
            << "\n";
  ++drawn_;
  std::cerr << std::flush;
}

void ProgressDisplay::Say(const std::string& message) {
  Erase();
  std::cerr << message << std::endl;
}

}  // namespace dreamsearch
