// received_plugin.h - a plugin's declarations as this version of the SDK knows them.
//
// The plugin may be built against another minor version: its structs are then longer or shorter
// than ours (dreamsearch/version.h). The copy has our structs throughout; a field that the
// plugin does not know has its default, and of a plugin newer than this host traits and kinds
// of component are left out that this version does not know. Texts and factories stay the
// plugin's own.
#pragma once

#include <filesystem>
#include <list>
#include <string>
#include <vector>

#include "dreamsearch/plugin.h"

namespace dreamsearch {

class ReceivedPlugin {
 public:
  // Checks what must hold for a descriptor to be read: magic number, major version, sizes.
  // Throws Failure 69; `file` is for messages only.
  ReceivedPlugin(const PluginDescriptor* sent, const std::filesystem::path& file);
  ReceivedPlugin(const ReceivedPlugin&) = delete;
  ReceivedPlugin& operator=(const ReceivedPlugin&) = delete;

  // Lives as long as this.
  const PluginDescriptor& plugin() const { return plugin_; }

 private:
  void ReceiveComponent(ComponentDescriptor component, const std::string& what, bool newer,
                        const std::filesystem::path& file);

  PluginDescriptor plugin_;
  std::vector<ComponentDescriptor> components_;
  std::list<std::vector<ParameterSpec>> parameters_;
  std::list<std::vector<MetricSpec>> metrics_;
  std::list<std::vector<RunPreset>> run_presets_;
};

}  // namespace dreamsearch
