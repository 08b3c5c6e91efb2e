// machine_fault.h - what neither the program nor a plugin is to blame for.
#pragma once

#include <cerrno>
#include <cstring>
#include <string>

#include "results/system/error.h"

namespace dreamsearch {

// Whether the machine is at fault (a full disk, a lock, a folder that cannot be written) and
// not the program or a plugin: what was interrupted by it can be resumed.
constexpr bool IsOfTheMachine(ExitCode code) {
  return code == ExitCode::kCannotCreate || code == ExitCode::kInputOutput ||
         code == ExitCode::kPermission;
}

// That a system call failed: "cannot WHAT: why". Failure 74 where memory, processes or descriptors
// have run out, which is no defect of ours; 70 otherwise.
inline Failure SystemFailure(const std::string& what, int error) {
  const bool scarce = error == EAGAIN || error == ENOMEM || error == EMFILE || error == ENFILE;
  return Failure(scarce ? ExitCode::kInputOutput : ExitCode::kInternal,
                 "cannot " + what + ": " + std::strerror(error));
}

}  // namespace dreamsearch
