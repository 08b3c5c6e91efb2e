#include "host/saving/npz.h"

#include <zlib.h>

#include <algorithm>
#include <limits>
#include <string_view>

#include "results/system/file.h"

namespace dreamsearch {
namespace {

// Numbers of a zip archive are little-endian, as those of this machine.
template <typename T>
void PutNumber(std::string* to, T number) {
  to->append(reinterpret_cast<const char*>(&number), sizeof number);
}

// NPY 1.0: magic, version, u16 length, a Python dictionary that ends in a line feed; all of it a
// multiple of 64 bytes.
std::string NpyHeader(const NpzArray& array) {
  std::string shape;
  for (const std::uint64_t extent : array.shape) shape += std::to_string(extent) + ",";
  std::string text =
      "{'descr': '" + array.type + "', 'fortran_order': False, 'shape': (" + shape + "), }";
  constexpr std::string_view kNumpyMagic("\x93NUMPY\x01\x00", 8);
  constexpr std::size_t kAlignment = 64;
  const std::size_t before = kNumpyMagic.size() + sizeof(std::uint16_t);
  text.append(kAlignment - 1 - (before + text.size()) % kAlignment, ' ');
  text += '\n';
  std::string header(kNumpyMagic);
  PutNumber(&header, static_cast<std::uint16_t>(text.size()));
  return header + text;
}

std::uint32_t Crc(std::uint32_t crc, const void* data, std::uint64_t bytes) {
  const auto* at = static_cast<const Bytef*>(data);
  while (bytes > 0) {
    const auto part = static_cast<uInt>(std::min<std::uint64_t>(bytes, 1u << 30));
    crc = static_cast<std::uint32_t>(::crc32(crc, at, part));
    at += part;
    bytes -= part;
  }
  return crc;
}

constexpr std::uint32_t kInExtra = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint16_t kZip64Version = 45;
constexpr std::uint16_t kZip64Extra = 1;
constexpr std::uint16_t kFirstDay = 1 << 5 | 1;  // 1 January 1980: equal episodes, equal bytes

struct ZipEntry {
  std::string name;
  std::uint32_t crc = 0;
  std::uint64_t bytes = 0;
  std::uint64_t offset = 0;  // of its local header
};

// What local and central headers share, from the version needed on. Sizes always lie in the zip64
// field, so that there is one layout for small and large files.
std::string CommonFields(const ZipEntry& entry, std::uint16_t extra_bytes) {
  std::string fields;
  PutNumber(&fields, kZip64Version);
  PutNumber<std::uint16_t>(&fields, 0);  // flags
  PutNumber<std::uint16_t>(&fields, 0);  // stored
  PutNumber<std::uint16_t>(&fields, 0);  // time
  PutNumber(&fields, kFirstDay);
  PutNumber(&fields, entry.crc);
  PutNumber(&fields, kInExtra);
  PutNumber(&fields, kInExtra);
  PutNumber(&fields, static_cast<std::uint16_t>(entry.name.size()));
  PutNumber(&fields, extra_bytes);
  return fields;
}

std::string LocalHeader(const ZipEntry& entry) {
  std::string header("PK\x03\x04");
  header += CommonFields(entry, 20) + entry.name;
  PutNumber(&header, kZip64Extra);
  PutNumber<std::uint16_t>(&header, 16);
  PutNumber(&header, entry.bytes);
  PutNumber(&header, entry.bytes);
  return header;
}

std::string CentralHeader(const ZipEntry& entry) {
  std::string header("PK\x01\x02");
  PutNumber(&header, kZip64Version);  // made by
  header += CommonFields(entry, 28);
  PutNumber<std::uint16_t>(&header, 0);  // comment
  PutNumber<std::uint16_t>(&header, 0);  // disk
  PutNumber<std::uint16_t>(&header, 0);  // internal attributes
  PutNumber<std::uint32_t>(&header, 0);  // external ones
  PutNumber(&header, kInExtra);          // offset
  header += entry.name;
  PutNumber(&header, kZip64Extra);
  PutNumber<std::uint16_t>(&header, 24);
  PutNumber(&header, entry.bytes);
  PutNumber(&header, entry.bytes);
  PutNumber(&header, entry.offset);
  return header;
}

std::string EndOfArchive(std::uint64_t entries, std::uint64_t offset, std::uint64_t bytes) {
  std::string end("PK\x06\x06");
  PutNumber<std::uint64_t>(&end, 44);  // bytes that follow in this record
  PutNumber(&end, kZip64Version);
  PutNumber(&end, kZip64Version);
  PutNumber<std::uint32_t>(&end, 0);  // disks
  PutNumber<std::uint32_t>(&end, 0);
  PutNumber(&end, entries);
  PutNumber(&end, entries);
  PutNumber(&end, bytes);
  PutNumber(&end, offset);
  end += "PK\x06\x07";
  PutNumber<std::uint32_t>(&end, 0);
  PutNumber(&end, offset + bytes);  // of the record above
  PutNumber<std::uint32_t>(&end, 1);
  end += "PK\x05\x06";
  PutNumber<std::uint32_t>(&end, 0);
  PutNumber(&end, std::numeric_limits<std::uint16_t>::max());  // see the record above
  PutNumber(&end, std::numeric_limits<std::uint16_t>::max());
  PutNumber(&end, kInExtra);
  PutNumber(&end, kInExtra);
  PutNumber<std::uint16_t>(&end, 0);
  return end;
}

}  // namespace

std::uint64_t WriteNpz(const std::filesystem::path& path, const std::vector<NpzArray>& arrays) {
  std::uint64_t written = 0;
  WriteWholeFile(path, [&](const Append& append) {
    const auto add = [&](std::string_view bytes) {
      append(bytes);
      written += bytes.size();
    };
    std::vector<ZipEntry> entries;
    for (const NpzArray& array : arrays) {
      const std::string header = NpyHeader(array);
      ZipEntry entry;
      entry.name = array.name + ".npy";
      entry.bytes = header.size() + array.bytes;
      entry.crc = Crc(Crc(0, header.data(), header.size()), array.data, array.bytes);
      entry.offset = written;
      add(LocalHeader(entry));
      add(header);
      if (array.bytes > 0) add({static_cast<const char*>(array.data), array.bytes});
      entries.push_back(std::move(entry));
    }
    std::string directory;
    for (const ZipEntry& entry : entries) directory += CentralHeader(entry);
    const std::uint64_t offset = written;
    add(directory);
    add(EndOfArchive(entries.size(), offset, directory.size()));
  });
  return written;
}

}  // namespace dreamsearch
