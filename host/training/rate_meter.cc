#include "host/training/rate_meter.h"

#include <algorithm>

namespace dreamsearch {

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

}  // namespace dreamsearch
