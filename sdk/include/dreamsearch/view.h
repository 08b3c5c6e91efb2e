// view.h - borrowed memory that crosses the plugin boundary.
//
// A view never owns: it is valid only during the call it is passed to, unless
// the call says otherwise. Matrices are row-major and dense. Eigen::Map turns
// one into a matrix without a copy.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>

#include "dreamsearch/version.h"

namespace dreamsearch {

// `size` consecutive values.
template <typename T>
struct View {
  T* data = nullptr;
  std::uint64_t size = 0;

  T& operator[](std::uint64_t i) const noexcept { return data[i]; }
  T* begin() const noexcept { return data; }
  T* end() const noexcept { return data + size; }
  bool empty() const noexcept { return size == 0; }
  // NOLINTNEXTLINE(google-explicit-constructor): reading what one may write is always right.
  operator View<const T>() const noexcept { return {data, size}; }
};

// `rows` x `cols` values, row-major, without gaps.
template <typename T>
struct MatrixView {
  T* data = nullptr;
  std::uint64_t rows = 0;
  std::uint64_t cols = 0;

  T& operator()(std::uint64_t row, std::uint64_t col) const noexcept {
    return data[row * cols + col];
  }
  View<T> row(std::uint64_t i) const noexcept { return {data + i * cols, cols}; }
  // The rows [first, first + count).
  MatrixView middle_rows(std::uint64_t first, std::uint64_t count) const noexcept {
    return {data + first * cols, count, cols};
  }
  std::uint64_t size() const noexcept { return rows * cols; }
  // NOLINTNEXTLINE(google-explicit-constructor)
  operator MatrixView<const T>() const noexcept { return {data, rows, cols}; }
};

// `size` structs in a row, each `stride` bytes behind the one before: their writer may know
// more of them, or fewer, than this version of T has fields. Of an element by reference read
// the fields of SDK 1.0; At gives every field.
template <typename T>
struct Records {
  class Iterator;

  const T* data = nullptr;
  std::uint64_t size = 0;
  std::uint64_t stride = sizeof(T);

  constexpr Records() = default;
  constexpr Records(const T* first, std::uint64_t count) : data(first), size(count) {}
  // NOLINTNEXTLINE(google-explicit-constructor): an array of this version's T.
  constexpr Records(View<const T> array) : data(array.data), size(array.size) {}

  const T& operator[](std::uint64_t i) const noexcept {
    return *reinterpret_cast<const T*>(reinterpret_cast<const std::byte*>(data) + i * stride);
  }
  // A copy, in which a field that the writer does not know has its default.
  T At(std::uint64_t i) const noexcept {
    T element{};
    std::memcpy(static_cast<void*>(&element), &(*this)[i],
                stride < sizeof element ? stride : sizeof element);
    return element;
  }
  Iterator begin() const noexcept { return {this, 0}; }
  Iterator end() const noexcept { return {this, size}; }
  bool empty() const noexcept { return size == 0; }
};

template <typename T>
class Records<T>::Iterator {
 public:
  using iterator_category = std::forward_iterator_tag;
  using value_type = T;
  using difference_type = std::ptrdiff_t;
  using pointer = const T*;
  using reference = const T&;

  Iterator() = default;
  Iterator(const Records* records, std::uint64_t index)
      : first_(records->data), stride_(records->stride), index_(index) {}
  const T& operator*() const noexcept {
    return *reinterpret_cast<const T*>(reinterpret_cast<const std::byte*>(first_) +
                                       index_ * stride_);
  }
  const T* operator->() const noexcept { return &**this; }
  Iterator& operator++() noexcept {
    ++index_;
    return *this;
  }
  Iterator operator++(int) noexcept {
    Iterator before = *this;
    ++index_;
    return before;
  }
  bool operator==(const Iterator& other) const noexcept { return index_ == other.index_; }

 private:
  const T* first_ = nullptr;
  std::uint64_t stride_ = 0;
  std::uint64_t index_ = 0;
};

// A batch of latents, one a row; cols is the model's latent_bytes. Opaque: copy
// rows, keep them, hand them back to the model they came from; never read them.
// Rows start at multiples of kLatentAlignment bytes (latent_bytes is a multiple).
using Latents = MatrixView<std::byte>;
using ConstLatents = MatrixView<const std::byte>;
inline constexpr std::uint64_t kLatentAlignment = 64;

}  // namespace dreamsearch
