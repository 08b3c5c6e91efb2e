// descriptor_check.h - what a plugin says of itself, held against what the SDK demands.
#pragma once

#include <filesystem>
#include <string>

#include "dreamsearch/plugin.h"

namespace dreamsearch {

// Checks a descriptor that a library's entry returned: version, layout tag, interface
// revision and every declaration. Calls no function of a component. Throws Failure 69 with
// what was expected and what was found; `file` is for messages only.
void CheckPluginDescriptor(const PluginDescriptor* plugin, const std::filesystem::path& file);

// Throws Failure 69, "plugin FILE: message".
[[noreturn]] void RefusePlugin(const std::filesystem::path& file, const std::string& message);

}  // namespace dreamsearch
