// progress.h - the progress of a sweep, on standard error.
//
// On a terminal the lines of the active runs are redrawn in place; elsewhere a
// line is printed when a run starts, ends or has moved on for half a minute.
// Colours only on a terminal and without NO_COLOR.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

namespace dreamsearch {

// "1,234,567".
std::string GroupDigits(std::uint64_t number);
// "1 run", "1,234 runs".
std::string Counted(std::uint64_t number, const std::string& noun);
// "45 s", "12 min", "3 h 20 min", "2 d 4 h".
std::string FormatDuration(double seconds);
// "812 B", "3.4 MB".
std::string FormatBytes(double bytes);

// How fast a run gets on and how long it still takes.
class RateMeter {
 public:
  // A rate over fewer than `least_steps` environment steps says nothing.
  explicit RateMeter(std::uint64_t least_steps = 1000) : least_steps_(least_steps) {}

  // Learning starts after the random steps, so time before `skip` does not count.
  void Add(double now_seconds, std::uint64_t env_step, bool counts);
  // Environment steps per second over the last two minutes; 0 while unknown.
  double Rate() const;

 private:
  std::uint64_t least_steps_;
  std::deque<std::pair<double, std::uint64_t>> points_;
};

class ProgressDisplay {
 public:
  ProgressDisplay();
  ~ProgressDisplay();

  struct Line {
    std::string label;  // "walker_walk mcts_pw seed 0"
    std::string stage;
    std::uint64_t env_step = 0;
    std::uint64_t env_steps_target = 0;
    double rate = 0;               // environment steps per second; 0: unknown
    double training_return = 0;    // NaN: none yet
    double evaluation_return = 0;  // NaN: none yet
    std::uint32_t threads = 1;     // that it may use
  };

  // The active runs, and a line about the whole sweep.
  void Show(const std::map<std::size_t, Line>& lines, const std::string& summary);
  // A message that stays, above the lines.
  void Say(const std::string& message);

 private:
  void Erase();
  std::string Format(const Line& line) const;

  bool terminal_;
  bool colour_;
  std::size_t drawn_ = 0;  // lines on the screen that are ours
  std::map<std::size_t, double> last_printed_;
};

}  // namespace dreamsearch
