#include "results/figures/axis.h"

#include <algorithm>
#include <cmath>

#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

std::string TickText(double value) {
  const double size = std::abs(value);
  if (size >= 1e6) return FormatNumber("%gM", value / 1e6);
  if (size >= 1e4) return FormatNumber("%gk", value / 1e3);
  return FormatNumber("%g", size < 1e-12 ? 0 : value);
}

// The smallest of 1, 2, 5 times a power of ten that gives at most `count` steps.
double NiceStep(double range, int count) {
  const double rough = range / count;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough * 0.9999999) return factor * power;
  }
  return 10 * power;
}

}  // namespace

Axis LinearAxis(double low, double high, int ticks, bool open_low, bool open_high) {
  if (!(high > low)) high = low + (low == 0 ? 1 : std::abs(low));
  const double step = NiceStep(high - low, ticks);
  Axis axis;
  axis.low = open_low ? std::floor(low / step + 1e-9) * step : low;
  axis.high = open_high ? std::ceil(high / step - 1e-9) * step : high;
  for (double tick = std::ceil(axis.low / step - 1e-9) * step; tick <= axis.high + step * 1e-6;
       tick += step) {
    axis.ticks.push_back({tick, TickText(std::abs(tick) < step * 1e-6 ? 0 : tick)});
  }
  return axis;
}

Axis LogAxis(double low, double high) {
  Axis axis;
  axis.low = std::max(low, high * 1e-6);
  axis.high = high;
  const bool decades = high / axis.low > 1000;
  for (double power = std::pow(10, std::floor(std::log10(axis.low))); power <= high; power *= 10) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = power * factor;
      if (tick < axis.low * 0.999 || tick > high * 1.001 || (decades && factor > 1)) continue;
      axis.ticks.push_back({tick, TickText(tick)});
    }
  }
  return axis;
}

}  // namespace dreamsearch::results
