// bridge.h - the Python program bridge.py, embedded at build time.
#pragma once

#include <string_view>

namespace dreamsearch {

std::string_view BridgeProgram();

}  // namespace dreamsearch
