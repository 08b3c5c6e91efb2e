// control_groups.h - the control groups (version 1 or 2) that a process is in.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace dreamsearch {

// A group of `controller`, and those around it, from the innermost. A container sees its own
// group as the root, whatever the path says.
struct ControlGroup {
  std::filesystem::path folder;
  std::string name;  // "/", "/user.slice"
  bool version1 = false;
};

// `membership` is /proc/self/cgroup, `root` /sys/fs/cgroup.
void ForEachControlGroup(const std::filesystem::path& membership, const std::filesystem::path& root,
                         const std::string& controller,
                         const std::function<void(const ControlGroup&)>& each);

}  // namespace dreamsearch
