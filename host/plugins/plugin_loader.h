// plugin_loader.h - loads a plugin into this process and checks what it offers.
//
// Only processes that may die call this: a run's worker, and the child that
// describes a plugin for the catalogue. The supervisor never does.
//
// Memory   a library stays loaded until the process exits; what is returned
//          lives as long.
// Threads  calls may come from several threads; they are serialised.
// Errors   Failure. The message names the file, what was expected and what
//          was found.
#pragma once

#include <filesystem>
#include <string_view>

#include "dreamsearch/plugin.h"

namespace dreamsearch {

// Loads the library once and returns its checked descriptor, as this SDK version knows it:
// version, sizes and every declaration hold before this returns, and no function of a
// component has been called. The floating-point modes of the
// calling thread are as they were.
//   kNotFound, kPermission  see CheckSharedLibrary.
//   kPluginRefused          not a library, not a plugin, of another SDK, with a
//                           missing symbol or dependency, with an inconsistent
//                           declaration, or built with -ffast-math.
const PluginDescriptor& LoadPlugin(const std::filesystem::path& file);

// The component of that kind and name (an alias is a name too).
//   kNotFound               the plugin has none; the message lists what it has.
const ComponentDescriptor& FindComponent(const PluginDescriptor& plugin, ComponentKind kind,
                                         std::string_view name);

}  // namespace dreamsearch
