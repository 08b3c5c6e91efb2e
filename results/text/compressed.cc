#include "results/text/compressed.h"

#include <zlib.h>

#include <string_view>

#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kMostBytes = 1'000'000'000;

[[noreturn]] void Refuse(const std::string& path, const std::string& why) {
  throw Failure(ExitCode::kBadInput, AbsolutePath(path) + ": " + why);
}

// Of all members, one after the other.
std::string Inflated(const std::string& path, const std::string& bytes) {
  z_stream stream = {};
  constexpr int kGzipOnly = 16 + MAX_WBITS;
  if (inflateInit2(&stream, kGzipOnly) != Z_OK) Refuse(path, "zlib does not start");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::string text;
  std::string block(1 << 16, '\0');
  int code = Z_OK;
  while (stream.avail_in > 0 && text.size() <= kMostBytes) {
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    code = inflate(&stream, Z_NO_FLUSH);
    if (code != Z_OK && code != Z_STREAM_END) break;
    text.append(block.data(), block.size() - stream.avail_out);
    if (code == Z_STREAM_END && stream.avail_in > 0) inflateReset(&stream);
  }
  // Output that did not fit into the last block.
  while (code == Z_OK && text.size() <= kMostBytes) {
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    code = inflate(&stream, Z_NO_FLUSH);
    if (code == Z_OK || code == Z_STREAM_END) {
      text.append(block.data(), block.size() - stream.avail_out);
    }
  }
  inflateEnd(&stream);
  if (text.size() > kMostBytes) Refuse(path, "holds more than 1 GB when it is unpacked.");
  if (code != Z_STREAM_END) Refuse(path, "is a gzip file that is damaged or cut short.");
  return text;
}

}  // namespace

std::string Unpacked(const std::string& path, const std::string& bytes) {
  const auto begins = [&](std::string_view magic) { return bytes.rfind(magic, 0) == 0; };
  if (begins("\x1f\x8b")) return Inflated(path, bytes);
  const struct {
    std::string_view magic;
    const char *kind, *command;
  } others[] = {{"\xfd"
                 "7zXZ",
                 "an xz", "xz -dk"},
                {"\x28\xb5\x2f\xfd", "a zstd", "zstd -dk"},
                {"BZh", "a bzip2", "bzip2 -dk"},
                {"PK\x03\x04", "a zip", "unzip"},
                {"7z\xbc\xaf", "a 7z", "7z x"}};
  for (const auto& [magic, kind, command] : others) {
    if (!begins(magic)) continue;
    Refuse(path, std::string("is ") + kind + " file. Unpack it first: " + command + " " +
                     ShellWord(AbsolutePath(path)));
  }
  return bytes;
}

}  // namespace dreamsearch
