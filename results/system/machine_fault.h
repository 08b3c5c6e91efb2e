// machine_fault.h - what neither the program nor a plugin is to blame for.
#pragma once

#include "results/system/error.h"

namespace dreamsearch {

// Whether the machine is at fault (a full disk, a lock, a folder that cannot be written) and
// not the program or a plugin: what was interrupted by it can be resumed.
constexpr bool IsOfTheMachine(ExitCode code) {
  return code == ExitCode::kCannotCreate || code == ExitCode::kInputOutput ||
         code == ExitCode::kPermission;
}

}  // namespace dreamsearch
