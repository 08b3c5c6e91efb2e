// state.h - named fields to bytes and back: what a checkpoint's parts are made of.
//
// Whoever has state lists its fields once, in a function that both sides call:
//
//   template <typename Archive> void Fields(Archive* archive) {
//     (*archive)("env_step", &env_step);
//     (*archive)("mean", &mean);
//   }
//
// A reader meets the fields in the order in which they were written, and by their names:
// one that is missing, surplus, renamed, or of another type or size is refused, never taken
// for another.
//
// Layout   a field is: u8 length of its name, name, u8 type, u64 number of entries, entries,
//          little-endian. A stream is pieces of u32 length and bytes, the last one empty; its
//          number of entries is 0.
// Memory   what is written or read goes through a buffer of 64 KiB; large arrays go
//          straight to or from where they live. No array is copied.
// Errors   Failure: 65 for what is not as expected, with the field; what the destination or
//          the source throws passes through.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "dreamsearch/stream.h"
#include "results/system/file.h"

namespace dreamsearch {

enum class FieldType : std::uint8_t {
  kUnsigned = 1,  // u64; every unsigned integer, enum and bool
  kSigned = 2,    // i64
  kReal = 3,      // f64
  kFloat = 4,     // f32
  kByte = 5,
  kText = 6,
  kStream = 7,  // what a component's Save writes
};

// The type of an entry that is stored as it lies in memory.
template <typename T>
constexpr FieldType FieldTypeOf() {
  if constexpr (std::is_same_v<T, std::uint64_t>) return FieldType::kUnsigned;
  if constexpr (std::is_same_v<T, std::int64_t>) return FieldType::kSigned;
  if constexpr (std::is_same_v<T, double>) return FieldType::kReal;
  if constexpr (std::is_same_v<T, float>) return FieldType::kFloat;
  if constexpr (std::is_same_v<T, std::uint8_t> || std::is_same_v<T, std::byte>) {
    return FieldType::kByte;
  }
}

class StateWriter {
 public:
  explicit StateWriter(Append append) : append_(std::move(append)) {}
  StateWriter(const StateWriter&) = delete;
  StateWriter& operator=(const StateWriter&) = delete;

  template <typename T>
  void operator()(const char* name, const T* value) {
    if constexpr (std::is_same_v<T, std::string>) {
      Field(name, FieldType::kText, value->data(), value->size(), 1);
    } else if constexpr (std::is_enum_v<T> || std::is_same_v<T, bool> ||
                         std::is_same_v<T, std::uint32_t>) {
      const auto number = static_cast<std::uint64_t>(*value);
      Array(name, &number, 1);
    } else {
      Array(name, value, 1);
    }
  }
  template <typename T>
  void operator()(const char* name, const std::vector<T>* values) {
    Array(name, values->data(), values->size());
  }
  template <typename T>
  void Array(const char* name, const T* entries, std::uint64_t count) {
    Field(name, FieldTypeOf<T>(), entries, count, sizeof(T));
  }
  // A field of whatever `save` writes. Its status, or the fault of the destination.
  Status Stream(const char* name, const std::function<Status(ByteSink* sink)>& save);

  // Hands over what is in the buffer; comes last.
  void Flush();

 private:
  class Sink;
  void Field(const char* name, FieldType type, const void* entries, std::uint64_t count,
             std::uint64_t entry_bytes);
  void Bytes(const void* data, std::uint64_t size);

  Append append_;
  std::string buffer_;
};

// The fields of a map: how many entries, then of each key and value.
template <typename Archive, typename Key>
void VisitMap(Archive* archive, const char* name, std::map<Key, std::string>* map) {
  std::vector<std::pair<Key, std::string>> items(map->begin(), map->end());
  std::uint64_t count = items.size();
  (*archive)(name, &count);
  for (std::uint64_t i = 0; i < count; ++i) {
    if (i == items.size()) items.emplace_back();
    (*archive)("key", &items[i].first);
    (*archive)("value", &items[i].second);
  }
  *map = {items.begin(), items.end()};
}

// Bytes that `write` writes, which go nowhere.
std::uint64_t StateBytes(const std::function<void(StateWriter* writer)>& write);

class StateReader {
 public:
  // Reads `size` bytes, all of them; throws if it cannot.
  using Source = std::function<void(void* data, std::uint64_t size)>;
  // `where` begins messages: "/path/checkpoint-10.ckpt, part 'replay'"; `advice` ends them.
  StateReader(Source source, std::uint64_t size, std::string where, std::string advice);
  StateReader(const StateReader&) = delete;
  StateReader& operator=(const StateReader&) = delete;

  template <typename T>
  void operator()(const char* name, T* value) {
    if constexpr (std::is_same_v<T, std::string>) {
      value->resize(Head(name, FieldType::kText, 1));
      Bytes(value->data(), value->size());
    } else if constexpr (std::is_enum_v<T> || std::is_same_v<T, bool> ||
                         std::is_same_v<T, std::uint32_t>) {
      std::uint64_t number = 0;
      Array(name, &number, 1);
      *value = static_cast<T>(number);
      if (static_cast<std::uint64_t>(*value) != number) RefuseNumber(name, number);
    } else {
      Array(name, value, 1);
    }
  }
  template <typename T>
  void operator()(const char* name, std::vector<T>* values) {
    values->resize(Head(name, FieldTypeOf<T>(), sizeof(T)));
    Bytes(values->data(), values->size() * sizeof(T));
  }
  // Of exactly `count` entries.
  template <typename T>
  void Array(const char* name, T* entries, std::uint64_t count) {
    const std::uint64_t found = Head(name, FieldTypeOf<T>(), sizeof(T));
    if (found != count) RefuseCount(name, count, found);
    Bytes(entries, count * sizeof(T));
  }
  // `load` must read all that was saved, or has a fault: kDataLoss.
  Status Stream(const char* name, const std::function<Status(ByteSource* source)>& load);

  // Hands on the bytes of a stream, piece by piece.
  void Stream(const char* name, const Append& append);

  // Refuses what fields are left; comes last.
  void Finish();

  [[noreturn]] void Refuse(const std::string& what) const;

  std::uint64_t left() const { return unread_ + (buffer_.size() - position_); }  // bytes

 private:
  class PieceSource;
  // The number of entries of the next field, which must be that one.
  std::uint64_t Head(const char* name, FieldType type, std::uint64_t entry_bytes);
  [[noreturn]] void RefuseCount(const char* name, std::uint64_t expected,
                                std::uint64_t found) const;
  [[noreturn]] void RefuseNumber(const char* name, std::uint64_t found) const;
  void Bytes(void* data, std::uint64_t size);
  Source source_;
  std::uint64_t unread_;  // bytes that the source still has
  std::string where_;
  std::string advice_;
  std::string buffer_;
  std::size_t position_ = 0;  // in the buffer
};

}  // namespace dreamsearch
