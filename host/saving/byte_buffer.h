// byte_buffer.h - plain values to bytes and back, for checkpoints.
//
// The bytes are of this machine class (little-endian x86-64); a checkpoint says
// so in its header. Reading past the end throws instead of inventing values.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "dreamsearch/stream.h"
#include "results/system/error.h"

namespace dreamsearch {

class ByteWriter {
 public:
  template <typename T>
  void Value(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  // Length first, then the values.
  template <typename T>
  void Array(const T* data, std::uint64_t size) {
    static_assert(std::is_trivially_copyable_v<T>);
    Value(size);
    if (size != 0) bytes_.append(reinterpret_cast<const char*>(data), size * sizeof(T));
  }
  template <typename T>
  void Vector(const std::vector<T>& values) {
    Array(values.data(), values.size());
  }
  void String(const std::string& text) { Array(text.data(), text.size()); }

  const std::string& bytes() const& { return bytes_; }
  std::string bytes() && { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class ByteReader {
 public:
  // `what` names the bytes in error messages. The bytes must outlive the reader.
  ByteReader(const std::string& bytes, std::string what) : bytes_(bytes), what_(std::move(what)) {}

  template <typename T>
  T Value() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value;
    std::memcpy(&value, Take(sizeof value), sizeof value);
    return value;
  }
  // An array whose length must be `size`.
  template <typename T>
  void ArrayInto(T* data, std::uint64_t size) {
    const auto stored = Value<std::uint64_t>();
    if (stored != size) Fail("an array of " + std::to_string(size), std::to_string(stored));
    const char* from = Take(size * sizeof(T));
    if (size != 0) std::memcpy(data, from, size * sizeof(T));
  }
  template <typename T>
  std::vector<T> Vector() {
    const auto size = Value<std::uint64_t>();
    if (size > (bytes_.size() - position_) / sizeof(T)) {
      Fail("at most what is left", std::to_string(size) + " entries");
    }
    std::vector<T> values(size);
    const char* from = Take(size * sizeof(T));
    if (size != 0) std::memcpy(values.data(), from, size * sizeof(T));
    return values;
  }
  std::string String() {
    const std::vector<char> characters = Vector<char>();
    return {characters.begin(), characters.end()};
  }
  bool at_end() const { return position_ == bytes_.size(); }

 private:
  const char* Take(std::uint64_t size) {
    if (size > bytes_.size() - position_) {
      Fail(std::to_string(size) + " more bytes", std::to_string(bytes_.size() - position_));
    }
    const char* at = bytes_.data() + position_;
    position_ += size;
    return at;
  }
  [[noreturn]] void Fail(const std::string& expected, const std::string& found) const {
    throw Failure(ExitCode::kBadInput,
                  "damaged " + what_ + ": expected " + expected + ", found " + found);
  }

  const std::string& bytes_;
  std::string what_;
  std::uint64_t position_ = 0;
};

// A component's Save into a string.
class StringSink final : public ByteSink {
 public:
  Status Write(const void* data, std::uint64_t size) noexcept override {
    try {
      bytes.append(static_cast<const char*>(data), size);
    } catch (...) {
      return Error(StatusCode::kInternal, "out of memory while saving");
    }
    return OkStatus();
  }
  std::string bytes;
};

// A component's Load from a string, which must outlive it.
class StringSource final : public ByteSource {
 public:
  explicit StringSource(const std::string& bytes) : bytes_(bytes) {}
  Status Read(void* data, std::uint64_t size) noexcept override {
    if (size > bytes_.size() - position_) {
      return Error(StatusCode::kDataLoss, "expected %llu more bytes, found %llu",
                   static_cast<unsigned long long>(size),
                   static_cast<unsigned long long>(bytes_.size() - position_));
    }
    std::memcpy(data, bytes_.data() + position_, size);
    position_ += size;
    return OkStatus();
  }
  std::uint64_t left() const { return bytes_.size() - position_; }

 private:
  const std::string& bytes_;
  std::uint64_t position_ = 0;
};

}  // namespace dreamsearch
