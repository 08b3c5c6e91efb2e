// sized.h - structs of another minor version of the SDK; the rule is in version.h.
//
// Only fields that came after 1.0 need care: the other side may be older and have made a
// shorter struct. Of version 1.0 there are none, so a plugin built against 1.0 needs nothing
// of this.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "dreamsearch/version.h"

namespace dreamsearch {

// `sent` as this version knows it: a field that the sender does not know has its default, one
// that only the sender knows is left out.
template <typename Struct>
Struct Received(const Struct& sent) noexcept {
  static_assert(std::is_trivially_copyable_v<Struct>);
  Struct received{};
  std::memcpy(static_cast<void*>(&received), static_cast<const void*>(&sent),
              std::min<std::uint64_t>(sent.struct_size, sizeof received));
  received.struct_size = sizeof received;
  return received;
}

// Whether whoever made `made` knows its field `field`. Ask before you write a later field of a
// struct that the caller made: Carries(*result, result->energy).
template <typename Struct, typename Field>
bool Carries(const Struct& made, const Field& field) noexcept {
  const auto* end = reinterpret_cast<const std::byte*>(&field) + sizeof field;
  return static_cast<std::uint64_t>(end - reinterpret_cast<const std::byte*>(&made)) <=
         made.struct_size;
}

}  // namespace dreamsearch
