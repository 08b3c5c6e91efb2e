#include "host/plugins/received_plugin.h"

#include <cinttypes>
#include <cstdio>
#include <string>
#include <utility>

#include "host/plugins/descriptor_check.h"

namespace dreamsearch {
namespace {

std::string Hex(std::uint64_t value) {
  char text[24];
  std::snprintf(text, sizeof text, "0x%016" PRIx64, value);
  return text;
}

constexpr std::uint64_t kLongestStruct = 65536;

// Whether a struct of `bytes` may be one of this major version.
template <typename Struct>
bool MayBe(std::uint64_t bytes) {
  return bytes >= kFirstSize<Struct> && bytes <= kLongestStruct && bytes % 8 == 0;
}

template <typename Struct>
std::string ExpectedBytes() {
  return "at least " + std::to_string(kFirstSize<Struct>) + " bytes, a multiple of 8";
}

void CheckHeader(const PluginDescriptor* sent, const std::filesystem::path& file) {
  if (sent == nullptr) RefusePlugin(file, "its entry returned no descriptor");
  const auto expect = [&](const std::string& what, const std::string& expected,
                          const std::string& found) {
    RefusePlugin(file, "expected " + what + " " + expected + ", found " + found +
                           "; rebuild the plugin against this SDK (" + SdkVersionText() + ")");
  };
  // The order is that of the fields: each check makes the next field readable.
  if (sent->magic != kPluginMagic) expect("the magic number", Hex(kPluginMagic), Hex(sent->magic));
  if (sent->sdk_major != DREAMSEARCH_SDK_MAJOR) {
    expect("SDK major version", std::to_string(DREAMSEARCH_SDK_MAJOR),
           std::to_string(sent->sdk_major));
  }
  if (!MayBe<PluginDescriptor>(sent->struct_size)) {
    expect("a descriptor of", ExpectedBytes<PluginDescriptor>(),
           std::to_string(sent->struct_size) + " bytes");
  }
}

// The elements as ours, in `kept`, which gives them their memory.
template <typename Struct>
Records<Struct> Receive(const Records<Struct>& sent, const std::string& what,
                        std::list<std::vector<Struct>>* kept, const std::filesystem::path& file) {
  constexpr std::uint64_t kMostEntries = 10000;
  if (sent.size > kMostEntries) {
    RefusePlugin(file, what + ": expected at most " + std::to_string(kMostEntries) +
                           " entries, found " + std::to_string(sent.size));
  }
  if (sent.size > 0 && sent.data == nullptr) {
    RefusePlugin(file,
                 what + ": found " + std::to_string(sent.size) + " entries at a null address");
  }
  if (!MayBe<Struct>(sent.stride)) {
    RefusePlugin(file, what + ": expected entries of " + ExpectedBytes<Struct>() + ", found " +
                           std::to_string(sent.stride) + " bytes");
  }
  std::vector<Struct>& own = kept->emplace_back();
  for (std::uint64_t i = 0; i < sent.size; ++i) own.push_back(sent.At(i));
  return {own.data(), own.size()};
}

bool Known(ComponentKind kind) {
  return TraitsOf(kind) != 0 || kind == ComponentKind::kEnvironment;
}

}  // namespace

ReceivedPlugin::ReceivedPlugin(const PluginDescriptor* sent, const std::filesystem::path& file) {
  CheckHeader(sent, file);
  plugin_ = Received(*sent);
  const bool newer = plugin_.sdk_minor > DREAMSEARCH_SDK_MINOR;
  std::list<std::vector<ComponentDescriptor>> all;
  const Records<ComponentDescriptor> components =
      Receive(plugin_.components, "the components", &all, file);
  for (std::uint64_t i = 0; i < components.size; ++i) {
    ReceiveComponent(components[i], "component " + std::to_string(i), newer, file);
  }
  plugin_.components = {components_.data(), components_.size()};
}

void ReceivedPlugin::ReceiveComponent(ComponentDescriptor component, const std::string& what,
                                      bool newer, const std::filesystem::path& file) {
  if (newer) {
    if (!Known(component.kind)) return;
    component.traits &= TraitsOf(component.kind);
  }
  component.parameters = Receive(component.parameters, what + "'s parameters", &parameters_, file);
  component.metrics = Receive(component.metrics, what + "'s metrics", &metrics_, file);
  component.run_presets =
      Receive(component.run_presets, what + "'s run presets", &run_presets_, file);
  components_.push_back(component);
}

}  // namespace dreamsearch
