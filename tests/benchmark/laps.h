// laps.h - times, operations and their share of the machine's limit, for the benchmarks of
// models.
//
// GFLOP/s counts two operations a multiply-add of the matrix products; everything
// else is free in this count. `share` is that rate over the machine's own limit: 1024 x
// 1024 x 1024 by the faster of Eigen and oneDNN, timed in this process before the first
// case.
#pragma once

#include <benchmark/benchmark.h>

#include <cstdio>
#include <ctime>
#include <string>

#include "dreamsearch/instruction_set.h"
#include "tests/benchmark/yardstick.h"

namespace dreamsearch {

// Seconds; of this thread's processor time if not said otherwise, so that a busy machine
// disturbs less.
inline double Now(clockid_t clock = CLOCK_THREAD_CPUTIME_ID) {
  std::timespec time;
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Operations of something that took `seconds`, their rate, and its share of the limit.
inline void Report(benchmark::State& state, double flops, double seconds,
                   const std::string& part = "") {
  state.counters[part + "GFLOP"] = flops * 1e-9;
  state.counters[part + "GFLOP/s"] = flops * 1e-9 / seconds;
  state.counters[part + "share"] = flops / seconds / MachineLimit();
}

// Seconds of an iteration so far: processor time of this thread, or wall time. The limit is
// measured before, so as not to count.
class Lap {
 public:
  explicit Lap(clockid_t clock = CLOCK_THREAD_CPUTIME_ID) : clock_(clock) {
    MachineLimit();
    begin_ = Now(clock_);
  }
  double Each(const benchmark::State& state) const {
    return (Now(clock_) - begin_) / static_cast<double>(state.iterations());
  }

 private:
  clockid_t clock_;
  double begin_ = 0;
};

inline int RunBenchmarks(int argc, char** argv) {
  LibraryProducts(argv);
  std::string fastest;
  const double limit = MachineLimit(&fastest);
  std::fprintf(stderr, "instruction set %s; large product %.1f GFLOP/s (%s)\n",
               InstructionSetName(ChosenInstructionSet()), limit * 1e-9, fastest.c_str());
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace dreamsearch
