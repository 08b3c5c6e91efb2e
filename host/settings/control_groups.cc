#include "host/settings/control_groups.h"

#include <fstream>
#include <sstream>

namespace dreamsearch {
namespace {

bool Lists(const std::string& names, const std::string& name) {
  std::istringstream list(names);
  for (std::string each; std::getline(list, each, ',');) {
    if (each == name) return true;
  }
  return false;
}

}  // namespace

void ForEachControlGroup(const std::filesystem::path& membership, const std::filesystem::path& root,
                         const std::string& controller,
                         const std::function<void(const ControlGroup&)>& each) {
  const auto outwards = [&each](const std::filesystem::path& top, const std::filesystem::path& path,
                                bool version1) {
    for (std::filesystem::path group = path.relative_path();; group = group.parent_path()) {
      each({top / group, "/" + group.string(), version1});
      if (group.empty()) return;
    }
  };
  std::ifstream file(membership);
  for (std::string line; std::getline(file, line);) {  // "0::/group", "4:cpu,cpuacct:/group"
    const std::size_t names = line.find(':');
    const std::size_t path = names == std::string::npos ? names : line.find(':', names + 1);
    if (path == std::string::npos) continue;
    const std::string controllers = line.substr(names + 1, path - names - 1);
    const std::filesystem::path group = line.substr(path + 1);
    if (controllers.empty()) {
      outwards(root, group, false);
    } else if (Lists(controllers, controller)) {
      outwards(root / controllers, group, true);
      if (controllers != controller) outwards(root / controller, group, true);
    }
  }
}

}  // namespace dreamsearch
