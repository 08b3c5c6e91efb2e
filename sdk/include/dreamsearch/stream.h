// stream.h - where a component's Save writes and its Load reads.
//
// The host frames, checksums and versions what passes through; a component
// writes plain bytes in an order of its own and reads them back in that order.
#pragma once

#include <cstdint>
#include <type_traits>

#include "dreamsearch/status.h"
#include "dreamsearch/view.h"

namespace dreamsearch {

class ByteSink {
 public:
  virtual Status Write(const void* data, std::uint64_t size) noexcept = 0;

 protected:
  ~ByteSink() = default;
};

class ByteSource {
 public:
  // kDataLoss when fewer than `size` bytes are left; then *data is unset.
  virtual Status Read(void* data, std::uint64_t size) noexcept = 0;

 protected:
  ~ByteSource() = default;
};

template <typename T>
Status WriteValue(ByteSink* sink, const T& value) noexcept {
  static_assert(std::is_trivially_copyable_v<T>);
  return sink->Write(&value, sizeof value);
}

template <typename T>
Status ReadValue(ByteSource* source, T* value) noexcept {
  static_assert(std::is_trivially_copyable_v<T>);
  return source->Read(value, sizeof *value);
}

// Receives the named arrays of a model, for `runner export`.
class TensorSink {
 public:
  // `shape` has the sizes of the dimensions, slowest first; `values` has as many
  // entries as their product.
  virtual Status Tensor(const char* name, View<const std::uint64_t> shape,
                        View<const float> values) noexcept = 0;

 protected:
  ~TensorSink() = default;
};

}  // namespace dreamsearch
