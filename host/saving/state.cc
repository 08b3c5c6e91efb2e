#include "host/saving/state.h"

#include <algorithm>
#include <cstring>
#include <optional>

#include "results/system/error.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kBufferBytes = 64 << 10;

const char* FieldTypeName(FieldType type) {
  switch (type) {
    case FieldType::kUnsigned:
      return "unsigned integers";
    case FieldType::kSigned:
      return "signed integers";
    case FieldType::kReal:
      return "doubles";
    case FieldType::kFloat:
      return "floats";
    case FieldType::kByte:
      return "bytes";
    case FieldType::kText:
      return "a text";
    case FieldType::kStream:
      return "a stream";
  }
  return "an unknown type";
}

}  // namespace

// --- writing -----------------------------------------------------------------

// What a component saves, as pieces as large as the buffer. A component must not see an
// exception, so the destination's is kept and thrown afterwards.
class StateWriter::Sink final : public ByteSink {
 public:
  explicit Sink(StateWriter* writer) : writer_(writer) { piece_.reserve(kBufferBytes); }

  Status Write(const void* data, std::uint64_t size) noexcept override {
    if (fault_) return Error(StatusCode::kInternal, "writing failed before");
    try {
      const auto* bytes = static_cast<const char*>(data);
      while (size > 0) {
        const std::uint64_t taken = std::min<std::uint64_t>(size, kBufferBytes - piece_.size());
        piece_.append(bytes, taken);
        bytes += taken;
        size -= taken;
        if (piece_.size() == kBufferBytes) HandOver();
      }
      return OkStatus();
    } catch (...) {
      fault_ = std::current_exception();
      return Error(StatusCode::kInternal, "writing failed");
    }
  }

  void Finish() {
    if (fault_) std::rethrow_exception(fault_);
    if (!piece_.empty()) HandOver();
    HandOver();
  }

 private:
  void HandOver() {
    const auto size = static_cast<std::uint32_t>(piece_.size());
    writer_->Bytes(&size, sizeof size);
    writer_->Bytes(piece_.data(), piece_.size());
    piece_.clear();
  }

  StateWriter* writer_;
  std::string piece_;
  std::exception_ptr fault_;
};

void StateWriter::Bytes(const void* data, std::uint64_t size) {
  if (size == 0) return;
  const auto* bytes = static_cast<const char*>(data);
  if (buffer_.size() + size <= kBufferBytes) {
    buffer_.append(bytes, size);
    return;
  }
  Flush();
  append_({bytes, size});
}

void StateWriter::Flush() {
  if (!buffer_.empty()) append_(buffer_);
  buffer_.clear();
}

void StateWriter::Field(const char* name, FieldType type, const void* entries, std::uint64_t count,
                        std::uint64_t entry_bytes) {
  const std::size_t length = std::strlen(name);
  if (length == 0 || length > 255) {
    throw Failure(ExitCode::kInternal, std::string("a field is called '") + name + "'");
  }
  std::string head(1, static_cast<char>(length));
  head += name;
  head += static_cast<char>(type);
  head.append(reinterpret_cast<const char*>(&count), sizeof count);
  Bytes(head.data(), head.size());
  Bytes(entries, count * entry_bytes);
}

Status StateWriter::Stream(const char* name, const std::function<Status(ByteSink* sink)>& save) {
  Field(name, FieldType::kStream, nullptr, 0, 1);
  Sink sink(this);
  const Status status = save(&sink);
  sink.Finish();
  return status;
}

std::uint64_t StateBytes(const std::function<void(StateWriter* writer)>& write) {
  std::uint64_t bytes = 0;
  StateWriter writer([&](std::string_view piece) { bytes += piece.size(); });
  write(&writer);
  writer.Flush();
  return bytes;
}

// --- reading -----------------------------------------------------------------

StateReader::StateReader(Source source, std::uint64_t size, std::string where, std::string advice)
    : source_(std::move(source)),
      unread_(size),
      where_(std::move(where)),
      advice_(std::move(advice)) {}

void StateReader::Refuse(const std::string& what) const {
  throw Failure(ExitCode::kBadInput, where_ + ": " + what + ". " + advice_);
}

void StateReader::RefuseCount(const char* name, std::uint64_t expected, std::uint64_t found) const {
  Refuse(std::string("field '") + name + "': expected " + std::to_string(expected) +
         " entries, found " + std::to_string(found));
}

void StateReader::RefuseNumber(const char* name, std::uint64_t found) const {
  Refuse(std::string("field '") + name + "': found " + std::to_string(found) +
         ", which no such field can hold");
}

void StateReader::Bytes(void* data, std::uint64_t size) {
  if (size > left()) {
    Refuse("expected " + std::to_string(size) + " more bytes, found " + std::to_string(left()));
  }
  auto* to = static_cast<char*>(data);
  const std::uint64_t buffered = std::min<std::uint64_t>(size, buffer_.size() - position_);
  if (buffered > 0) std::memcpy(to, buffer_.data() + position_, buffered);
  position_ += buffered;
  to += buffered;
  size -= buffered;
  if (size == 0) return;
  if (size >= kBufferBytes) {
    source_(to, size);
    unread_ -= size;
    return;
  }
  buffer_.resize(std::min<std::uint64_t>(unread_, kBufferBytes));
  source_(buffer_.data(), buffer_.size());
  unread_ -= buffer_.size();
  std::memcpy(to, buffer_.data(), size);
  position_ = size;
}

std::uint64_t StateReader::Head(const char* name, FieldType type, std::uint64_t entry_bytes) {
  const std::string expected = std::string("expected the field '") + name + "'";
  if (left() == 0) Refuse(expected + ", found no more fields");
  std::uint8_t length = 0;
  Bytes(&length, 1);
  std::string found(length, '\0');
  Bytes(found.data(), found.size());
  std::uint8_t code = 0;
  Bytes(&code, 1);
  std::uint64_t count = 0;
  Bytes(&count, sizeof count);
  if (found != name) Refuse(expected + ", found the field '" + found + "'");
  const auto found_type = static_cast<FieldType>(code);
  if (found_type != type) {
    Refuse(std::string("field '") + name + "': expected " + FieldTypeName(type) + ", found " +
           FieldTypeName(found_type));
  }
  if (count > left() / entry_bytes) {
    Refuse(std::string("field '") + name + "': it has " + std::to_string(count) +
           " entries, more than the " + std::to_string(left()) + " bytes that follow hold");
  }
  return count;
}

// The pieces of a stream as one.
class StateReader::PieceSource final : public ByteSource {
 public:
  explicit PieceSource(StateReader* reader) : reader_(reader) {}

  Status Read(void* data, std::uint64_t size) noexcept override {
    if (fault_) return Error(StatusCode::kDataLoss, "reading failed before");
    try {
      auto* to = static_cast<char*>(data);
      while (size > 0) {
        if (!Available()) {
          return Error(StatusCode::kDataLoss, "expected %llu more bytes, found the end",
                       static_cast<unsigned long long>(size));
        }
        const std::uint64_t taken = std::min<std::uint64_t>(size, left_);
        reader_->Bytes(to, taken);
        to += taken;
        size -= taken;
        left_ -= taken;
      }
      return OkStatus();
    } catch (...) {
      fault_ = std::current_exception();
      return Error(StatusCode::kDataLoss, "reading failed");
    }
  }

  // Whether there is more in this stream.
  bool Available() {
    if (left_ == 0 && !ended_) {
      std::uint32_t size = 0;
      reader_->Bytes(&size, sizeof size);
      left_ = size;
      ended_ = size == 0;
    }
    return !ended_;
  }

  void RethrowFault() const {
    if (fault_) std::rethrow_exception(fault_);
  }

 private:
  StateReader* reader_;
  std::uint64_t left_ = 0;  // in this piece
  bool ended_ = false;
  std::exception_ptr fault_;
};

Status StateReader::Stream(const char* name,
                           const std::function<Status(ByteSource* source)>& load) {
  Head(name, FieldType::kStream, 1);
  PieceSource source(this);
  const Status status = load(&source);
  source.RethrowFault();
  if (status.ok() && source.Available()) {
    return Error(StatusCode::kDataLoss, "Load left some of what Save wrote unread");
  }
  return status;
}

void StateReader::Stream(const char* name, const Append& append) {
  Head(name, FieldType::kStream, 1);
  std::string piece;
  for (;;) {
    std::uint32_t size = 0;
    Bytes(&size, sizeof size);
    if (size == 0) return;
    if (size > left()) Bytes(nullptr, size);  // refuses
    piece.resize(size);
    Bytes(piece.data(), size);
    append(piece);
  }
}

void StateReader::Finish() {
  if (left() == 0) return;
  std::uint8_t length = 0;
  Bytes(&length, 1);
  std::string found(std::min<std::uint64_t>(length, left()), '\0');
  Bytes(found.data(), found.size());
  Refuse("expected no more fields, found the field '" + found + "'");
}

}  // namespace dreamsearch
