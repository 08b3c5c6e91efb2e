// memory.h - the memory that a command may use, and how its runs share it.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <limits>

#include "host/settings/run_options.h"

namespace dreamsearch {

inline constexpr std::uint64_t kUnknownMemory = std::numeric_limits<std::uint64_t>::max();

// Bytes that this process and its children can take without driving others out: what the machine
// has free, and no more than its control groups and its job of Slurm leave. kUnknownMemory
// if nothing says.
std::uint64_t AvailableMemory();

// What control groups leave. `membership` is /proc/self/cgroup, `root` /sys/fs/cgroup.
std::uint64_t MemoryOfControlGroups(const std::filesystem::path& membership,
                                    const std::filesystem::path& root);

// The resident size of a process, 0 if it is gone; and this process's largest so far.
std::uint64_t ResidentBytes(pid_t pid);
std::uint64_t PeakResidentBytes();

// How many runs are worked on at once, and what each may take.
struct WorkLimits {
  int jobs = 1;
  std::uint64_t memory_bytes = 0;  // resident, of each run; 0: no limit
};
// `run_bytes` is what a run takes; 0: unknown, so that only the cores count.
WorkLimits LimitsOf(const ProcessOptions& options, std::uint64_t run_bytes, std::uint32_t cores,
                    std::uint64_t available);
// Of this machine, now.
WorkLimits LimitsOf(const ProcessOptions& options, std::uint64_t run_bytes);

}  // namespace dreamsearch
