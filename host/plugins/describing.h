// describing.h - describes a plugin in a child process.
//
// So a library that crashes, hangs, exits or floods its output while it is
// loaded is a refusal with a reason and nothing more.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "host/plugins/description.h"

namespace dreamsearch {

// Descriptions that were made before, for the many commands of a sweep on a cluster. One counts for
// a file that still has its path and its digest.
struct KnownPlugins {
  std::vector<PluginDescription> plugins;

  // Null if there is none.
  const PluginDescription* Find(const std::string& file, const std::string& sha256) const;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("plugins", &plugins);
  }
};
// What kKnownPluginsVariable names. None if nothing is named, or if it is not what `runner submit`
// wrote: then each file is described anew.
inline constexpr char kKnownPluginsVariable[] = "DREAMSEARCH_KNOWN_PLUGINS";
KnownPlugins ReadKnownPlugins();

struct ScanOptions {
  // The program that describes a plugin: it is called with `arguments` and then
  // the file, and calls DescribePluginMain.
  std::string program = "/proc/self/exe";
  std::vector<std::string> arguments = {"describe-plugin"};
  std::chrono::milliseconds timeout = std::chrono::seconds(10);
  int children = 2;  // at once
  KnownPlugins known;
};

// Describes one file in a child, which is gone when this returns, unless it is known. Never throws
// for what the library does.
PluginDescription DescribeInChild(const std::string& file, const ScanOptions& options);

// The child's side: loads the plugin, writes its description to
// descriptor kDescribeDescriptor, and ends the process without running the
// library's destructors. Returns only if that descriptor is not open.
inline constexpr int kDescribeDescriptor = 3;
int DescribePluginMain(const std::string& file);

}  // namespace dreamsearch
