// descriptor_check.h - what a plugin says of itself, held against what the SDK demands.
#pragma once

#include <filesystem>
#include <string>

#include "dreamsearch/plugin.h"

namespace dreamsearch {

// Checks every declaration of a plugin, which is the copy of received_plugin.h. Calls no
// function of a component. Throws Failure 69 with what was expected and what was found; `file`
// is for messages only.
void CheckDeclarations(const PluginDescriptor& plugin, const std::filesystem::path& file);

// "1.0": of this host.
std::string SdkVersionText();

// Throws Failure 69, "plugin FILE: message".
[[noreturn]] void RefusePlugin(const std::filesystem::path& file, const std::string& message);

}  // namespace dreamsearch
