// status.h - how a call across the plugin boundary says that it failed.
//
// A Status is a plain value: a code and, on failure, a short text. It owns no
// memory, so it may cross between libraries built with different flags.
#pragma once

#include <cstdarg>
#include <cstdint>
#include <cstdio>

#include "dreamsearch/version.h"

namespace dreamsearch {

enum class StatusCode : std::uint32_t {
  kOk = 0,
  kInvalidArgument = 1,     // a view has the wrong size, a value is out of range
  kFailedPrecondition = 2,  // the call came too early, or the object cannot serve it
  kNotFinite = 3,           // NaN or infinity appeared; outputs are unset
  kDiverged = 4,            // the simulator reported a physics warning
  kUnimplemented = 5,       // a call that this component cannot serve
  kDataLoss = 6,            // saved bytes are not what Save() wrote
  kInternal = 7,            // a defect of the component
};

// A failed call sets `message` to one line: what was expected, what was found.
struct [[nodiscard]] Status {
  static constexpr std::uint32_t kMessageSize = 252;

  StatusCode code;
  char message[kMessageSize];  // zero-terminated, empty when ok

  Status() noexcept : code(StatusCode::kOk) { message[0] = '\0'; }

  bool ok() const noexcept { return code == StatusCode::kOk; }
};

inline Status OkStatus() noexcept { return Status(); }

// Builds a failed Status from a printf format; longer texts are cut.
__attribute__((format(printf, 2, 3))) inline Status Error(StatusCode code, const char* format,
                                                          ...) noexcept {
  Status status;
  status.code = code;
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(status.message, Status::kMessageSize, format, arguments);
  va_end(arguments);
  return status;
}

inline const char* StatusCodeName(StatusCode code) noexcept {
  switch (code) {
    case StatusCode::kOk:
      return "ok";
    case StatusCode::kInvalidArgument:
      return "invalid argument";
    case StatusCode::kFailedPrecondition:
      return "failed precondition";
    case StatusCode::kNotFinite:
      return "not finite";
    case StatusCode::kDiverged:
      return "diverged";
    case StatusCode::kUnimplemented:
      return "unimplemented";
    case StatusCode::kDataLoss:
      return "data loss";
    case StatusCode::kInternal:
      return "internal error";
  }
  return "unknown status";
}

}  // namespace dreamsearch
