#include "host/plugins/catalogue.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <system_error>
#include <thread>
#include <tuple>

#include "results/text/names.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// Every entry of a folder called *.so, sorted.
std::vector<std::string> Libraries(const std::filesystem::path& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".so") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<PluginDescription> DescribeAll(const std::vector<std::string>& files,
                                           const ScanOptions& options) {
  std::vector<PluginDescription> descriptions(files.size());
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < files.size(); i = next++) {
      descriptions[i] = DescribeInChild(files[i], options);
    }
  };
  std::vector<std::jthread> threads;
  const auto count = std::min<std::size_t>(std::max(options.children, 1), files.size());
  for (std::size_t i = 0; i < count; ++i) threads.emplace_back(work);
  threads.clear();  // joins
  return descriptions;
}

std::string FolderNames(const std::vector<std::filesystem::path>& folders) {
  std::vector<std::string> names;
  for (const auto& folder : folders) {
    std::error_code error;
    std::filesystem::directory_iterator file(folder, error);
    const bool none = !error && std::none_of(begin(file), end(file), [](const auto& entry) {
      return entry.path().extension() == ".so";
    });
    names.push_back(folder.string() + (none ? " (no .so there)" : ""));
  }
  return names.empty() ? "no plugin folder (none exists)" : JoinNames(names);
}

// "mcts_pw" is called so in planner_mcts_pw.so and in mcts_pw.so.
bool IsCalled(const std::string& file, std::string_view name) {
  const std::string stem = std::filesystem::path(file).stem().string();
  return stem == name || stem.ends_with("_" + std::string(name));
}

}  // namespace

Catalogue Catalogue::Scan(const std::vector<std::filesystem::path>& folders,
                          const ScanOptions& options) {
  Catalogue catalogue;
  std::vector<std::string> files;
  std::vector<std::size_t> folder_of_file;
  for (const auto& folder : folders) {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::canonical(folder, error);
    if (error || !std::filesystem::is_directory(path)) continue;
    if (std::find(catalogue.folders_.begin(), catalogue.folders_.end(), path) !=
        catalogue.folders_.end()) {
      continue;
    }
    try {
      for (std::string& file : Libraries(path)) {
        if (IsUtf8(file)) {
          files.push_back(std::move(file));
        } else {
          catalogue.refusals_.push_back(
              {ShellWord(file), ExitCode::kPluginRefused,
               "plugin " + ShellWord(file) +
                   ": expected a path in UTF-8, found other bytes. Rename the file"});
        }
      }
    } catch (const std::filesystem::filesystem_error& failure) {
      catalogue.warnings_.push_back("plugin folder " + path.string() +
                                    " is skipped: " + failure.code().message());
      continue;
    }
    folder_of_file.resize(files.size(), catalogue.folders_.size());
    catalogue.folders_.push_back(path);
  }

  using Key = std::pair<ComponentKind, std::string>;
  struct Claim {
    std::size_t folder;
    PluginInfo plugin;
  };
  std::map<Key, Claim> claims;
  std::vector<PluginDescription> descriptions = DescribeAll(files, options);
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (descriptions[i].refused) {
      catalogue.refusals_.push_back(descriptions[i].refusal);
      continue;
    }
    catalogue.described_.plugins.push_back(descriptions[i]);
    for (ComponentInfo& component : descriptions[i].components) {
      const std::string kind = ComponentKindName(component.kind);
      // True if the name is this component's to use.
      const auto claim = [&](const std::string& name) {
        const Key key{component.kind, name};
        const auto [old, added] =
            claims.try_emplace(key, Claim{folder_of_file[i], component.plugin});
        if (added) return true;
        const PluginInfo& other = old->second.plugin;
        if (old->second.folder == folder_of_file[i]) {
          catalogue.ambiguous_.try_emplace(
              key, kind + " '" + name + "' is offered by two plugins of one folder, " + other.path +
                       " and " + component.plugin.path + "; remove one of them");
        } else if (other.sha256 != component.plugin.sha256) {
          catalogue.warnings_.push_back(kind + " '" + name + "' of " + component.plugin.path +
                                        " is hidden by the one of " + other.path);
        }
        return false;
      };
      if (!claim(component.name)) continue;
      std::erase_if(component.aliases, [&](const std::string& alias) { return !claim(alias); });
      catalogue.components_.push_back(std::make_shared<const ComponentInfo>(std::move(component)));
    }
  }
  for (const auto& [key, message] : catalogue.ambiguous_) catalogue.warnings_.push_back(message);
  std::erase_if(catalogue.components_, [&](const auto& component) {
    return catalogue.ambiguous_.contains({component->kind, component->name});
  });
  std::sort(catalogue.components_.begin(), catalogue.components_.end(),
            [](const auto& a, const auto& b) {
              return std::tie(a->kind, a->name) < std::tie(b->kind, b->name);
            });
  return catalogue;
}

std::shared_ptr<const ComponentInfo> Catalogue::Find(ComponentKind kind,
                                                     std::string_view name) const {
  const std::string text(name);
  if (const auto both = ambiguous_.find({kind, text}); both != ambiguous_.end()) {
    throw Failure(ExitCode::kPluginRefused, both->second);
  }
  std::vector<std::string> known;
  for (const auto& component : components_) {
    if (component->kind != kind) continue;
    const auto& aliases = component->aliases;
    if (component->name == name ||
        std::find(aliases.begin(), aliases.end(), text) != aliases.end()) {
      return component;
    }
    known.push_back(component->name);
  }
  std::vector<std::string> refused;
  for (const PluginRefusal& refusal : refusals_) {
    if (IsCalled(refusal.path, name)) throw Failure(refusal.code, refusal.message);
    refused.push_back(std::filesystem::path(refusal.path).filename().string());
  }
  std::string message = std::string("no ") + ComponentKindName(kind) + " '" + text + "' in " +
                        FolderNames(folders_) + ". " + KnownNames(name, known);
  // What is wrong with the one plugin that was refused is most likely why the name is unknown.
  if (refusals_.size() == 1) {
    message += " Refused: " + refusals_.front().message + ".";
  } else if (!refused.empty()) {
    message += " Refused: " + JoinNames(refused) +
               " (`runner list` with the same --plugin-path says why).";
  }
  if (message.find("Did you mean") == std::string::npos) {
    message += " Plugins of your own are found with --plugin-path FOLDER.";
  }
  throw Failure(ExitCode::kNotFound, message);
}

std::shared_ptr<const ComponentInfo> Catalogue::DefaultModel(bool learns) const {
  std::vector<std::string> found;
  for (const std::string& name : NamesOf(ComponentKind::kModel, kDefault)) {
    if (Find(ComponentKind::kModel, name)->Has(kLearns) == learns) found.push_back(name);
  }
  if (found.size() == 1) return Find(ComponentKind::kModel, found.front());
  if (found.empty()) {
    throw Failure(ExitCode::kNotFound, "no plugin in " + FolderNames(folders_) +
                                           " has a model that is taken where " +
                                           "none is named; expected --model NAME. Known: " +
                                           JoinNames(NamesOf(ComponentKind::kModel)) + ".");
  }
  throw Failure(ExitCode::kUsage, "expected --model NAME: " + JoinNames(found) +
                                      " each declare that they are taken where none is named");
}

std::vector<std::string> Catalogue::NamesOf(ComponentKind kind, std::uint32_t traits) const {
  std::vector<std::string> names;
  for (const auto& component : components_) {
    if (component->kind == kind && (component->traits & traits) == traits) {
      names.push_back(component->name);
    }
  }
  return names;
}

std::vector<std::filesystem::path> PluginFolders(const std::vector<std::string>& first) {
  std::vector<std::filesystem::path> folders;
  const auto add = [&](const std::filesystem::path& folder) {
    const auto path = std::filesystem::absolute(folder).lexically_normal();
    std::error_code error;
    for (const auto& name : {path, std::filesystem::weakly_canonical(path, error)}) {
      if (IsUtf8(name.string())) continue;
      throw Failure(ExitCode::kNotFound,
                    "plugin folder " + ShellWord(name.string()) +
                        ": expected a path in UTF-8, found other bytes. Rename the folder");
    }
    if (std::find(folders.begin(), folders.end(), path) == folders.end()) folders.push_back(path);
  };
  for (const std::string& entry : first) {
    for (const std::string& folder : SplitList(entry, ':')) {
      std::error_code error;
      if (!std::filesystem::is_directory(folder, error)) {
        throw Failure(
            ExitCode::kNotFound,
            "--plugin-path: expected a folder, found " +
                std::filesystem::absolute(folder).string() +
                (std::filesystem::exists(folder, error) ? ", a file" : ", which does not exist"));
      }
      add(folder);
    }
  }
  if (const char* variable = std::getenv("DREAMSEARCH_PLUGIN_PATH"); variable != nullptr) {
    for (const std::string& folder : SplitList(variable, ':')) add(folder);
  }
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) add(program.parent_path().parent_path() / "lib/dreamsearch/plugins");
  return folders;
}

}  // namespace dreamsearch
