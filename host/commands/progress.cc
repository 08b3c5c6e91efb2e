#include "host/commands/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>

#include "host/acting/activity_clock.h"

namespace dreamsearch {
namespace {

std::string Printf(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

std::size_t TerminalWidth() {
  winsize size{};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 100;
}

}  // namespace

std::string GroupDigits(std::uint64_t number) {
  std::string digits = std::to_string(number);
  for (std::ptrdiff_t i = static_cast<std::ptrdiff_t>(digits.size()) - 3; i > 0; i -= 3) {
    digits.insert(static_cast<std::size_t>(i), ",");
  }
  return digits;
}

std::string Counted(std::uint64_t number, const std::string& noun) {
  return GroupDigits(number) + " " + noun + (number == 1 ? "" : "s");
}

std::string FormatDuration(double seconds) {
  if (!(seconds >= 0) || seconds > 1e9) return "unknown time";
  const auto s = static_cast<std::uint64_t>(std::llround(seconds));
  if (s < 100) return std::to_string(s) + " s";
  if (s < 100 * 60) return std::to_string((s + 30) / 60) + " min";
  if (s < 48 * 3600) {
    return std::to_string(s / 3600) + " h " + std::to_string(s % 3600 / 60) + " min";
  }
  return std::to_string(s / 86400) + " d " + std::to_string(s % 86400 / 3600) + " h";
}

std::string FormatBytes(double bytes) {
  if (bytes < 1000) return Printf("%.0f B", bytes);
  if (bytes < 1e6) return Printf("%.1f kB", bytes / 1e3);
  if (bytes < 1e9) return Printf("%.1f MB", bytes / 1e6);
  return Printf("%.1f GB", bytes / 1e9);
}

void RateMeter::Add(double now_seconds, std::uint64_t env_step, bool counts) {
  if (!counts) {
    points_.clear();
    return;
  }
  points_.emplace_back(now_seconds, env_step);
  while (points_.size() > 2 && now_seconds - points_[1].first > 120) points_.pop_front();
}

double RateMeter::Rate() const {
  if (points_.size() < 2) return 0;
  const double seconds = points_.back().first - points_.front().first;
  const std::uint64_t steps = points_.back().second - points_.front().second;
  return seconds > 3 && steps >= least_steps_ ? static_cast<double>(steps) / seconds : 0;
}

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

std::string ProgressDisplay::Format(const Line& line) const {
  const double done = line.env_steps_target == 0 ? 0
                                                 : static_cast<double>(line.env_step) /
                                                       static_cast<double>(line.env_steps_target);
  std::string text = line.label + "  " + Printf("%3.0f%%", 100 * done) + "  " +
                     GroupDigits(line.env_step) + " of " + GroupDigits(line.env_steps_target) +
                     " steps";
  if (line.rate > 0) text += "  " + Printf("%.0f steps/s", line.rate);
  if (std::isfinite(line.training_return)) {
    text += "  return " + Printf("%.1f", line.training_return);
  }
  if (std::isfinite(line.evaluation_return)) {
    text += "  evaluated " + Printf("%.1f", line.evaluation_return);
  }
  if (line.rate > 0 && line.env_step < line.env_steps_target) {
    text += "  " +
            FormatDuration(static_cast<double>(line.env_steps_target - line.env_step) / line.rate) +
            " left";
  }
  if (line.threads > 1) text += "  " + Counted(line.threads, "thread");
  return text + "  (" + line.stage + ")";
}

void ProgressDisplay::Show(const std::map<std::size_t, Line>& lines, const std::string& summary) {
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
