// matrix.h - borrowed matrices and the memory behind them.
//
// Every batch is a column-major matrix [features, columns]: one column a sample,
// and in a sequence the columns are time-major, column t * B + b. A weight is
// [out, in], column-major too, so that a product with one column reads it once,
// in order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <type_traits>

namespace dreamsearch::networks {

using Index = std::int64_t;

// `rows` x `cols` values, column-major; column j starts at data + j * stride.
template <typename T>
struct Mat {
  T* data = nullptr;
  Index rows = 0;
  Index cols = 0;
  Index stride = 0;

  Mat() = default;
  Mat(T* data_in, Index rows_in, Index cols_in) : Mat(data_in, rows_in, cols_in, rows_in) {}
  Mat(T* data_in, Index rows_in, Index cols_in, Index stride_in)
      : data(data_in), rows(rows_in), cols(cols_in), stride(stride_in) {}

  T* col(Index j) const { return data + j * stride; }
  T& operator()(Index i, Index j) const { return data[j * stride + i]; }
  Mat Cols(Index first, Index count) const { return {col(first), rows, count, stride}; }
  Mat Rows(Index first, Index count) const { return {data + first, count, cols, stride}; }
  bool dense() const { return stride == rows || cols <= 1; }
  Index size() const { return rows * cols; }
  explicit operator bool() const { return data != nullptr; }
  // NOLINTNEXTLINE(google-explicit-constructor): as View
  operator Mat<const T>() const requires(!std::is_const_v<T>) { return {data, rows, cols, stride}; }
};

// Memory that only grows, aligned for the widest vector unit. Growing loses the
// contents; once it has held the largest shape it never allocates again.
template <typename T>
class Buffer {
 public:
  Buffer() = default;
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  ~Buffer() { Free(); }

  T* Reserve(Index size) {
    if (size > capacity_) {
      Free();
      data_ = static_cast<T*>(::operator new(static_cast<std::size_t>(size) * sizeof(T), kAlign));
      capacity_ = size;
      std::memset(data_, 0, static_cast<std::size_t>(size) * sizeof(T));
    }
    return data_;
  }
  Mat<T> Shape(Index rows, Index cols) { return {Reserve(rows * cols), rows, cols}; }
  T* data() const { return data_; }

 private:
  static constexpr std::align_val_t kAlign{64};
  void Free() {
    if (data_ != nullptr) ::operator delete(data_, kAlign);
    data_ = nullptr;
    capacity_ = 0;
  }

  T* data_ = nullptr;
  Index capacity_ = 0;
};

template <typename T>
void SetZero(Mat<T> m) {
  for (Index j = 0; j < m.cols; ++j) {
    std::memset(m.col(j), 0, static_cast<std::size_t>(m.rows) * sizeof(T));
  }
}

template <typename T>
void Copy(Mat<const std::type_identity_t<T>> from, Mat<T> to) {
  for (Index j = 0; j < to.cols; ++j) {
    std::memcpy(to.col(j), from.col(j), static_cast<std::size_t>(to.rows) * sizeof(T));
  }
}

}  // namespace dreamsearch::networks
