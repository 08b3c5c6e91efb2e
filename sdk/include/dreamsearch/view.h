// view.h - borrowed memory that crosses the plugin boundary.
//
// A view never owns: it is valid only during the call it is passed to, unless
// the call says otherwise. Matrices are row-major and dense. Eigen::Map turns
// one into a matrix without a copy.
#pragma once

#include <cstddef>
#include <cstdint>

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

// A batch of latents, one a row; cols is the model's latent_bytes. Opaque: copy
// rows, keep them, hand them back to the model they came from; never read them.
// Rows start at multiples of kLatentAlignment bytes (latent_bytes is a multiple).
using Latents = MatrixView<std::byte>;
using ConstLatents = MatrixView<const std::byte>;
inline constexpr std::uint64_t kLatentAlignment = 64;

}  // namespace dreamsearch
