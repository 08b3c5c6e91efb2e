// both_versions.h - what a field of the next minor version is, where this one has none.
#pragma once

#include "dreamsearch/plugin.h"

namespace dreamsearch {

// The next version's headers, see grow_headers.cmake.
inline constexpr bool kGrown = DREAMSEARCH_SDK_MINOR >= 1000;

// What `grown` is where nobody set it.
inline constexpr double kUnset = 7.5;

// The field of a struct that was received, kUnset where this version has none.
template <typename Struct>
double GrownOf(const Struct& received) {
  if constexpr (kGrown) {
    return received.grown;
  } else {
    static_cast<void>(received);
    return kUnset;
  }
}

template <typename Struct>
constexpr void SetGrown(double value, Struct* made) {
  if constexpr (kGrown) {
    made->grown = value;
  } else {
    static_cast<void>(value);
    static_cast<void>(made);
  }
}

// Of a struct that the caller made, if it knows the field.
template <typename Struct>
void GiveGrown(double value, Struct* result) {
  if constexpr (kGrown) {
    if (Carries(*result, result->grown)) result->grown = value;
  } else {
    static_cast<void>(value);
    static_cast<void>(result);
  }
}

}  // namespace dreamsearch
