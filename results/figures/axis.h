// axis.h - where an axis begins and ends, and its ticks.
#pragma once

#include <string>
#include <vector>

namespace dreamsearch::results {

struct Tick {
  double at = 0;
  std::string text;  // 20k, 1.5M, 0.25
};

struct Axis {
  double low = 0, high = 1;
  std::vector<Tick> ticks;
};

// From low to high with about so many ticks at round numbers. An open end moves out to the
// next tick.
Axis LinearAxis(double low, double high, int ticks, bool open_low, bool open_high);
// Of at most six decades. high > 0.
Axis LogAxis(double low, double high);

}  // namespace dreamsearch::results
