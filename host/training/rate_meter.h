// rate_meter.h - how fast a run gets on.
#pragma once

#include <cstdint>
#include <deque>
#include <utility>

namespace dreamsearch {

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

}  // namespace dreamsearch
