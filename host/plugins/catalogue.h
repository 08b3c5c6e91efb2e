// catalogue.h - what all plugins of some folders offer, without loading them here.
//
// Each library is described in a child process (describing.h). What is kept are owning
// copies; they outlive the catalogue.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dreamsearch/plugin.h"
#include "host/plugins/describing.h"
#include "host/plugins/description.h"

namespace dreamsearch {

class Catalogue {
 public:
  // Describes every *.so of the folders. A folder that does not exist is
  // skipped. Of a component offered twice the earlier folder's is kept, with a
  // warning; offered twice in one folder it cannot be used, and Find says so.
  static Catalogue Scan(const std::vector<std::filesystem::path>& folders,
                        const ScanOptions& options = {});

  // The component with that name or alias.
  //   kNotFound       none has; the message lists the known ones. If a refused
  //                   library is called so, its refusal is thrown instead.
  //   kPluginRefused  two plugins of one folder offer it.
  std::shared_ptr<const ComponentInfo> Find(ComponentKind kind, std::string_view name) const;

  // The model of a command that names none: the one that declares kDefault, of those that
  // learn or of those that do not.
  //   kNotFound       no plugin has one; the message lists what there is to name.
  //   kUsage          several have; it lists them.
  std::shared_ptr<const ComponentInfo> DefaultModel(bool learns) const;

  // The names of the components of that kind that have all of these traits.
  std::vector<std::string> NamesOf(ComponentKind kind, std::uint32_t traits = 0) const;

  // Sorted by kind, then name.
  const std::vector<std::shared_ptr<const ComponentInfo>>& components() const {
    return components_;
  }
  const std::vector<PluginRefusal>& refusals() const { return refusals_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  const std::vector<std::filesystem::path>& folders() const { return folders_; }
  // What each library that was not refused says of itself, whether it is used or not.
  const KnownPlugins& described() const { return described_; }

 private:
  std::vector<std::shared_ptr<const ComponentInfo>> components_;
  std::vector<PluginRefusal> refusals_;
  std::vector<std::string> warnings_;
  std::vector<std::filesystem::path> folders_;
  KnownPlugins described_;
  // Names that two plugins of one folder claim, and the message for each.
  std::map<std::pair<ComponentKind, std::string>, std::string> ambiguous_;
};

// Where plugins are looked for, in order: `first`, the entries of
// $DREAMSEARCH_PLUGIN_PATH, and lib/dreamsearch/plugins beside this program's
// folder. Absolute, each once.
std::vector<std::filesystem::path> PluginFolders(const std::vector<std::string>& first);

}  // namespace dreamsearch
