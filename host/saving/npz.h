// npz.h - named arrays as a file that NumPy's load reads.
//
// An .npz file is a zip archive of .npy files, here stored without compression: each has a header
// that says type and shape, and the entries as they lie in memory, rows one after the other.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace dreamsearch {

struct NpzArray {
  std::string name;                  // "observations"
  std::string type;                  // NumPy's: "<f4", "<i8", "|b1"
  std::vector<std::uint64_t> shape;  // slowest dimension first
  const void* data = nullptr;        // [shape], borrowed
  std::uint64_t bytes = 0;           // of all entries
};

// Writes the file, whatever its size, and returns its bytes. Throws what WriteWholeFile throws.
std::uint64_t WriteNpz(const std::filesystem::path& path, const std::vector<NpzArray>& arrays);

}  // namespace dreamsearch
