// progress.h - the progress of a sweep, on standard error.
//
// On a terminal the lines of the active runs are redrawn in place; elsewhere a
// line is printed when a run starts, ends or has moved on for half a minute.
// Colours only on a terminal and without NO_COLOR.
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "host/processes/supervisor.h"

namespace dreamsearch {

class ProgressDisplay final : public SweepObserver {
 public:
  ProgressDisplay();
  ~ProgressDisplay() override;

  // The active runs, and a line about the whole sweep.
  void Show(const std::map<std::size_t, ActiveLine>& lines, const std::string& summary) override;
  // A message that stays, above the lines.
  void Say(const std::string& message) override;

 private:
  void Erase();
  std::string Format(const ActiveLine& line) const;

  bool terminal_;
  bool colour_;
  std::size_t drawn_ = 0;  // lines on the screen that are ours
  std::map<std::size_t, double> last_printed_;
};

}  // namespace dreamsearch
