// outputs.h - memory that a component fills, so that what it leaves unset or writes beside it is
// noticed in every run, for some nanoseconds a call.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "dreamsearch/view.h"

namespace dreamsearch {

// `size` numbers between two guards.
class Outputs {
 public:
  explicit Outputs(std::uint64_t size) : numbers_(size + 2, kGuard) { Fill(0); }

  double* data() { return numbers_.data() + 1; }
  const double* data() const { return numbers_.data() + 1; }
  std::uint64_t size() const { return numbers_.size() - 2; }
  View<double> view() { return {data(), size()}; }
  View<const double> view() const { return {data(), size()}; }
  const double* begin() const { return data(); }
  const double* end() const { return data() + size(); }
  double operator[](std::uint64_t i) const { return data()[i]; }

  void Fill(double number) { std::fill_n(data(), size(), number); }
  // NaN: what stays so was not set.
  void Unset() { Fill(std::numeric_limits<double>::quiet_NaN()); }
  // Whether nothing was written just before or just after the numbers.
  bool intact() const { return numbers_.front() == kGuard && numbers_.back() == kGuard; }

 private:
  static constexpr double kGuard = -6.0221408570001e-201;

  std::vector<double> numbers_;
};

}  // namespace dreamsearch
