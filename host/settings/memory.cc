#include "host/settings/memory.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>

#include "host/settings/control_groups.h"
#include "host/settings/cores.h"

namespace dreamsearch {
namespace {

constexpr std::uint64_t kMebibyte = 1 << 20;

// The number after `name` in a file of lines "name   number"; kUnknownMemory if there is none.
std::uint64_t Entry(const std::filesystem::path& path, const std::string& name) {
  std::ifstream file(path);
  std::uint64_t number = 0;
  for (std::string word; file >> word;) {
    if (word == name) return file >> number ? number : kUnknownMemory;
  }
  return kUnknownMemory;
}

// The number that a file consists of; kUnknownMemory if it has none ("max").
std::uint64_t Number(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::uint64_t number = 0;
  return file >> number ? number : kUnknownMemory;
}

// Pages of files that are not in use can be taken.
std::uint64_t FreeOf(const ControlGroup& group) {
  const char* limit_name = group.version1 ? "memory.limit_in_bytes" : "memory.max";
  const std::uint64_t limit = Number(group.folder / limit_name);
  const std::uint64_t used =
      Number(group.folder / (group.version1 ? "memory.usage_in_bytes" : "memory.current"));
  if (limit == kUnknownMemory || used == kUnknownMemory) return kUnknownMemory;
  std::uint64_t files =
      Entry(group.folder / "memory.stat", group.version1 ? "total_inactive_file" : "inactive_file");
  files = files == kUnknownMemory ? 0 : std::min(files, used);
  return limit - std::min(limit, used - files);
}

// The memory of the job on this node, in MiB; 0 is all of the node's.
std::uint64_t MemoryOfSlurm() {
  const auto variable = [](const char* name) {
    const char* text = std::getenv(name);
    return text == nullptr ? 0 : std::strtoull(text, nullptr, 10);
  };
  const std::uint64_t whole = variable("SLURM_MEM_PER_NODE");
  const std::uint64_t each = variable("SLURM_MEM_PER_CPU") * variable("SLURM_CPUS_ON_NODE");
  const std::uint64_t megabytes = whole != 0 ? whole : each;
  return megabytes == 0 ? kUnknownMemory : megabytes * kMebibyte;
}

}  // namespace

std::uint64_t MemoryOfControlGroups(const std::filesystem::path& membership,
                                    const std::filesystem::path& root) {
  std::uint64_t least = kUnknownMemory;
  ForEachControlGroup(membership, root, "memory", [&least](const ControlGroup& group) {
    least = std::min(least, FreeOf(group));
  });
  return least;
}

std::uint64_t AvailableMemory() {
  const std::uint64_t kibibytes = Entry("/proc/meminfo", "MemAvailable:");
  return std::min({kibibytes == kUnknownMemory ? kUnknownMemory : kibibytes * 1024,
                   MemoryOfControlGroups("/proc/self/cgroup", "/sys/fs/cgroup"), MemoryOfSlurm()});
}

std::uint64_t ResidentBytes(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/statm");
  std::uint64_t size = 0, resident = 0;
  if (!(file >> size >> resident)) return 0;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

std::uint64_t PeakResidentBytes() {
  const std::uint64_t kibibytes = Entry("/proc/self/status", "VmHWM:");
  return kibibytes == kUnknownMemory ? 0 : kibibytes * 1024;
}

WorkLimits LimitsOf(const ProcessOptions& options, std::uint64_t run_bytes, std::uint32_t cores,
                    std::uint64_t available) {
  WorkLimits limits;
  limits.jobs = options.jobs;
  if (limits.jobs == 0) {
    std::uint64_t most = cores;
    if (run_bytes > 0 && available != kUnknownMemory) {
      most = std::min(most, available / run_bytes);
    }
    limits.jobs = static_cast<int>(std::max<std::uint64_t>(1, most));
  }
  limits.memory_bytes = options.memory_limit_bytes;
  if (limits.memory_bytes == kShareOfMemory) {
    limits.memory_bytes =
        available == kUnknownMemory
            ? 0
            : std::max<std::uint64_t>(1, available / static_cast<std::uint64_t>(limits.jobs));
  }
  return limits;
}

WorkLimits LimitsOf(const ProcessOptions& options, std::uint64_t run_bytes) {
  return LimitsOf(options, run_bytes, AvailableCores().count, AvailableMemory());
}

}  // namespace dreamsearch
