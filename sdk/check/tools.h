// tools.h - what the laws measure with: arrays that notice a write beside them, transcripts that
// say where two courses part, bytes that components save to.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "law.h"

namespace dreamsearch::check {

inline constexpr double kUnset = std::numeric_limits<double>::quiet_NaN();

// `size` values between two guards. Doubles begin as NaN, so that what a call leaves unset shows.
// The first value lies at a multiple of kLatentAlignment.
template <typename T>
class Guarded {
 public:
  Guarded(std::string name, std::uint64_t size)
      : name_(std::move(name)), size_(size), memory_(Allocate(Bytes())) {
    std::memset(memory_.get(), kGuard, Bytes());
    Unset();
  }

  // Forgets what was written.
  void Unset() {
    if constexpr (std::is_floating_point_v<T>) {
      std::fill(data(), data() + size_, std::numeric_limits<T>::quiet_NaN());
    } else {
      std::memset(static_cast<void*>(data()), kGuard, size_ * sizeof(T));
    }
  }
  T* data() const { return reinterpret_cast<T*>(memory_.get() + kGuardBytes); }
  std::uint64_t size() const { return size_; }
  View<T> view() const { return {data(), size_}; }
  T& operator[](std::uint64_t i) const { return data()[i]; }
  MatrixView<T> rows(std::uint64_t count) const {
    return {data(), count, count == 0 ? size_ : size_ / count};
  }

  // Breaks the law if a guard was written to.
  void CheckGuards() const {
    const std::byte* at = memory_.get();
    for (std::uint64_t i = 0; i < Bytes(); ++i) {
      if (i == kGuardBytes) i += size_ * sizeof(T);
      if (i >= Bytes() || at[i] == static_cast<std::byte>(kGuard)) continue;
      const auto offset = static_cast<long long>(i) - static_cast<long long>(kGuardBytes);
      Break("no byte written outside " + name_ + " (" + std::to_string(size_) + " values)",
            Format("a write %lld bytes from its beginning, which has %llu", offset,
                   static_cast<unsigned long long>(size_ * sizeof(T))));
    }
  }
  // Breaks the law if a value was not set, or is not finite.
  void CheckSet() const {
    for (std::uint64_t i = 0; i < size_; ++i) {
      if (std::isfinite(static_cast<double>(data()[i]))) continue;
      Break(
          "every value of " + name_ + " set to a finite number",
          Format("value %llu of %llu is %s", static_cast<unsigned long long>(i),
                 static_cast<unsigned long long>(size_),
                 std::isnan(static_cast<double>(data()[i])) ? "NaN, or was not set" : "infinite"));
    }
  }
  void CheckRange(double low, double high) const {
    for (std::uint64_t i = 0; i < size_; ++i) {
      const double value = static_cast<double>(data()[i]);
      if (value >= low && value <= high) continue;
      Break(name_ + " in [" + Number(low) + ", " + Number(high) + "]",
            Format("value %llu is %s", static_cast<unsigned long long>(i), Number(value).c_str()));
    }
  }

 private:
  static constexpr int kGuard = 0xa5;
  static constexpr std::uint64_t kGuardBytes = 4 * kLatentAlignment;
  struct Free {
    void operator()(std::byte* memory) const {
      ::operator delete (memory, std::align_val_t{kLatentAlignment});
    }
  };
  static std::byte* Allocate(std::uint64_t bytes) {
    return static_cast<std::byte*>(::operator new (bytes, std::align_val_t{kLatentAlignment}));
  }
  std::uint64_t Bytes() const { return 2 * kGuardBytes + size_ * sizeof(T); }

  std::string name_;
  std::uint64_t size_;
  std::unique_ptr<std::byte, Free> memory_;
};

// What a component answered, in order, to be compared with what it answered another time.
class Transcript {
 public:
  void Add(const std::string& what, double value) { entries_.push_back({what, value}); }
  void Add(const std::string& what, View<const double> values) {
    for (std::uint64_t i = 0; i < values.size; ++i) {
      Add(what + "[" + std::to_string(i) + "]", values[i]);
    }
  }
  void Append(const std::string& prefix, const Transcript& more) {
    for (const Entry& entry : more.entries_) Add(prefix + entry.what, entry.value);
  }
  // Breaks the law unless this one has the bits of `expected`; with a tolerance, unless each value
  // is within that share of the larger of 1 and the expected one.
  void CheckEquals(const Transcript& expected, const std::string& promise,
                   double tolerance = 0) const {
    Expect(entries_.size() == expected.entries_.size(),
           promise + ": " + std::to_string(expected.entries_.size()) + " answers",
           std::to_string(entries_.size()));
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Entry& now = entries_[i];
      const Entry& then = expected.entries_[i];
      const bool equal = std::memcmp(&now.value, &then.value, sizeof now.value) == 0 ||
                         (tolerance > 0 && std::abs(now.value - then.value) <=
                                               tolerance * std::max(1.0, std::abs(then.value)));
      Expect(equal, promise + ": " + then.what + " = " + Number(then.value), Number(now.value));
    }
  }
  bool Equals(const Transcript& other) const {
    return std::equal(entries_.begin(), entries_.end(), other.entries_.begin(),
                      other.entries_.end(), [](const Entry& a, const Entry& b) {
                        return std::memcmp(&a.value, &b.value, sizeof a.value) == 0;
                      });
  }

 private:
  struct Entry {
    std::string what;
    double value;
  };
  std::vector<Entry> entries_;
};

// What a component saves, to be loaded again.
class Bytes final : public ByteSink, public ByteSource {
 public:
  Status Write(const void* data, std::uint64_t size) noexcept override {
    const auto* from = static_cast<const char*>(data);
    bytes.insert(bytes.end(), from, from + size);
    return OkStatus();
  }
  Status Read(void* data, std::uint64_t size) noexcept override {
    if (bytes.size() - at < size) {
      return Error(StatusCode::kDataLoss, "%llu bytes wanted, %llu left",
                   static_cast<unsigned long long>(size),
                   static_cast<unsigned long long>(bytes.size() - at));
    }
    if (size > 0) std::memcpy(data, bytes.data() + at, size);
    at += size;
    return OkStatus();
  }
  std::vector<char> bytes;
  std::uint64_t at = 0;
};

// Breaks the law unless the call succeeded.
inline void ExpectOk(const Status& status, std::string_view call) {
  if (!status.ok()) Break(std::string(call) + " to succeed", Text(status));
}
// Breaks the law unless the call failed like that, with a sentence.
inline void ExpectRefusal(const Status& status, StatusCode code, const std::string& call) {
  Expect(status.code == code, call + " to be refused as " + StatusCodeName(code),
         status.ok() ? "success" : Text(status));
  Expect(status.message[0] != '\0', call + " to say why it was refused", "an empty message");
}

struct Destroyer {
  template <typename T>
  void operator()(T* component) const {
    NoteCall("Destroy");
    component->Destroy();
  }
};
template <typename T>
using Owned = std::unique_ptr<T, Destroyer>;

// What a factory made. Leaves with Refused where it did not.
struct Refused {
  Status status;
};
template <typename T>
Owned<T> Take(const Status& status, T* made) {
  if (!status.ok()) {
    Expect(made == nullptr, "a factory that fails to set *result to null", "an object");
    Expect(status.message[0] != '\0', "a factory that fails to say why", "an empty message");
    throw Refused{status};
  }
  Expect(made != nullptr, "a factory that succeeds to make an object", "null");
  return Owned<T>(made);
}

}  // namespace dreamsearch::check
