#include "host/plugins/plugin_loader.h"

#include <boost/dll/shared_library.hpp>
#include <cfenv>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

#include "host/plugins/description.h"
#include "host/plugins/descriptor_check.h"
#include "host/plugins/elf.h"
#include "host/plugins/received_plugin.h"
#include "results/system/error.h"
#include "results/text/names.h"

namespace dreamsearch {
namespace {

// The rounding and denormal modes of this thread, put back at the end of the
// scope: a library built with -ffast-math sets flush-to-zero while it is loaded.
class FloatingPointGuard {
 public:
  FloatingPointGuard() { Save(); }
  ~FloatingPointGuard() { Restore(); }
  FloatingPointGuard(const FloatingPointGuard&) = delete;
  FloatingPointGuard& operator=(const FloatingPointGuard&) = delete;

#if defined(__x86_64__)
  void Save() {
    mxcsr_ = _mm_getcsr();
    __asm__ __volatile__("fnstcw %0" : "=m"(x87_));
  }
  void Restore() const {
    _mm_setcsr(mxcsr_);
    __asm__ __volatile__("fldcw %0" : : "m"(x87_));
  }
  // What changed since the guard was made; empty if nothing did.
  std::string Changes() const {
    constexpr unsigned kFlushToZero = 0x8000, kDenormalsAreZero = 0x0040, kStatusFlags = 0x3f;
    std::uint16_t x87 = 0;
    __asm__ __volatile__("fnstcw %0" : "=m"(x87));
    const unsigned changed = (_mm_getcsr() ^ mxcsr_) & ~kStatusFlags;
    if ((changed & (kFlushToZero | kDenormalsAreZero)) != 0) {
      return "it, or a library it needs, was built with -ffast-math: loading it makes "
             "denormal numbers zero in the whole process. Compile and link it without that flag";
    }
    if (changed != 0 || x87 != x87_) {
      return "loading it changes the rounding mode or the floating-point exceptions of the "
             "whole process";
    }
    return "";
  }

 private:
  unsigned mxcsr_ = 0;
  std::uint16_t x87_ = 0;
#else
  void Save() { std::fegetenv(&environment_); }
  void Restore() const { std::fesetenv(&environment_); }
  std::string Changes() const { return ""; }

 private:
  std::fenv_t environment_;
#endif
};

// The entry of a library built against another SDK: of another major version, or before 1.0.
std::string OtherEntry(const boost::dll::shared_library& library) {
  constexpr int kMostVersions = 100;
  for (const char* name : {"dreamsearch_sdk_", "dreamsearch_plugin_v"}) {
    for (int version = 0; version < kMostVersions; ++version) {
      std::string symbol = name + std::to_string(version);
      if (library.has(symbol)) return symbol;
    }
  }
  return "";
}

struct LoadedPlugin {
  boost::dll::shared_library library;
  std::unique_ptr<const ReceivedPlugin> received;  // null until it was checked
  std::optional<Failure> refusal;                  // a second load gives the same answer
};

// The dynamic loader's own sentence out of Boost's "... (dlerror system message:
// PATH: sentence): Bad file descriptor".
std::string LoaderSentence(const std::string& what, const std::string& path) {
  constexpr std::string_view kBefore = "dlerror system message: ";
  const auto begin = what.find(kBefore);
  if (begin == std::string::npos) return what;
  std::string sentence = what.substr(begin + kBefore.size());
  sentence = sentence.substr(0, sentence.rfind(')'));
  if (sentence.starts_with(path + ": ")) sentence = sentence.substr(path.size() + 2);
  return sentence;
}

boost::dll::shared_library LoadLibrary(const std::string& path, const FloatingPointGuard& guard) {
  boost::dll::shared_library library;
  try {
    // rtld_now: a missing symbol is an error here, not the end of the process at
    // the first call.
    library.load(path, boost::dll::load_mode::rtld_now | boost::dll::load_mode::rtld_local);
  } catch (const std::system_error& error) {
    RefusePlugin(path, "the dynamic loader says: " + LoaderSentence(error.what(), path));
  } catch (const std::exception& error) {
    // What an initialiser throws ends the process in most dynamic loaders, and passes through
    // others.
    throw Failure(ExitCode::kPluginCrashed, "plugin " + path +
                                                ": crashed while it was loaded: an exception left "
                                                "an initialiser: " +
                                                error.what());
  }
  const std::string changes = guard.Changes();
  if (!changes.empty()) {
    // Unloading what just ran its initialisers is no safer than keeping it.
    static auto& kept = *new std::vector<boost::dll::shared_library>;
    kept.push_back(std::move(library));
    RefusePlugin(path, changes);
  }
  return library;
}

std::unique_ptr<const ReceivedPlugin> CheckedPlugin(const boost::dll::shared_library& library,
                                                    const std::string& path) {
  if (!library.has(kPluginEntrySymbol)) {
    const std::string other = OtherEntry(library);
    const bool old = other.starts_with("dreamsearch_plugin_");
    RefusePlugin(
        path, std::string("expected the symbol ") + kPluginEntrySymbol + ", found " +
                  (other.empty() ? "none of the kind: it is not a dreamsearch "
                                   "plugin, which ends with DREAMSEARCH_PLUGIN(...)"
                                 : other +
                                       (old ? ": it was built before SDK 1.0"
                                            : " of another major version of the SDK") +
                                       "; rebuild it against this SDK (" + SdkVersionText() + ")"));
  }
  auto received = std::make_unique<const ReceivedPlugin>(
      library.get<const PluginDescriptor*()>(kPluginEntrySymbol)(), path);
  CheckDeclarations(received->plugin(), path);
  return received;
}

}  // namespace

const PluginDescriptor& LoadPlugin(const std::filesystem::path& file) {
  static auto& mutex = *new std::mutex;
  // Never destroyed: unloading a library whose objects live is a crash.
  static auto& loaded = *new std::map<std::string, LoadedPlugin>;
  const std::lock_guard lock(mutex);

  CheckSharedLibrary(file);
  const std::string path = std::filesystem::canonical(file).string();
  LoadedPlugin& plugin = loaded[path];
  if (plugin.refusal) throw *plugin.refusal;
  if (plugin.received == nullptr) {
    const FloatingPointGuard guard;
    try {
      plugin.library = LoadLibrary(path, guard);
      plugin.received = CheckedPlugin(plugin.library, path);
    } catch (const Failure& error) {
      plugin.refusal = error;
      throw;
    }
  }
  return plugin.received->plugin();
}

const ComponentDescriptor& FindComponent(const PluginDescriptor& plugin, ComponentKind kind,
                                         std::string_view name) {
  std::vector<std::string> known;
  for (const ComponentDescriptor& component : plugin.components) {
    if (component.kind != kind) continue;
    if (component.name == name) return component;
    for (const std::string& alias :
         SplitList(component.aliases == nullptr ? "" : component.aliases, ',')) {
      if (alias == name) return component;
    }
    known.push_back(component.name);
  }
  throw Failure(ExitCode::kNotFound, std::string("no ") + ComponentKindName(kind) + " '" +
                                         std::string(name) + "' in plugin " + plugin.name + ". " +
                                         KnownNames(name, known));
}

}  // namespace dreamsearch
