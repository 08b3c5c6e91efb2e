// cores.h - the processor cores that a command may use, and how its runs share them.
//
// Results do not depend on the number of threads, so a run uses the cores that no
// other run needs, and their number may change at any time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <set>
#include <string>

#include "results/system/file_descriptor.h"

namespace dreamsearch {

// Cores that this process can keep busy.
struct Cores {
  std::uint32_t count = 1;
  // Equal for processes that have the same ones: the affinity mask, and the control group
  // whose limit is less than the mask has.
  std::string name;
};
Cores AvailableCores();

// What control groups (version 1 or 2) leave of the processor time, in cores.
struct ControlGroupLimit {
  double cores = std::numeric_limits<double>::infinity();
  std::string group;  // the one that sets it, this process's or one around it; empty: none
};
// `membership` is /proc/self/cgroup, `root` /sys/fs/cgroup.
ControlGroupLimit LimitOfControlGroups(const std::filesystem::path& membership,
                                       const std::filesystem::path& root);

// Shares cores out among the running runs of all `runner` commands that have the same ones and
// the same folder for temporary files (TMPDIR, /tmp). Every run holds a place in a row: a
// lock on a byte of an empty file in that folder, so that it is free when its command
// ends, however it does. Where the file cannot be used, a command knows its own runs alone,
// and two commands may take the same idle core.
class CoreSharing {
 public:
  explicit CoreSharing(const Cores& cores = AvailableCores());
  // The same with the places in `file`.
  CoreSharing(std::uint32_t cores, const std::filesystem::path& file);

  // Takes the first free place for a run of this command.
  std::size_t Enter();
  void Leave(std::size_t place);

  // Threads that the runs of this command may use now, by place. All runs have the same
  // number, or the first ones one more; at least 1.
  std::map<std::size_t, std::uint32_t> Threads() const;

 private:
  bool TakenElsewhere(std::size_t first, std::size_t count) const;

  const std::uint32_t cores_;
  FileDescriptor file_;  // closed if it cannot be used
  std::set<std::size_t> own_;
};

}  // namespace dreamsearch
