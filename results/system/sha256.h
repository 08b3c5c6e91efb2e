// sha256.h - SHA-256 in hexadecimal, as one stream, of bytes and of files.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "results/system/error.h"

namespace dreamsearch {

class Sha256 {
 public:
  static constexpr std::size_t kBytes = 32;

  Sha256();  // throws Failure 70 if libcrypto has none
  ~Sha256();

  void Add(std::string_view bytes);
  // Of all that was added; nothing may be added afterwards.
  std::array<unsigned char, kBytes> Finish();
  std::string FinishHex();  // 64 lower-case digits

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// 64 lower-case hexadecimal digits.
std::string Sha256Hex(std::string_view bytes);
// The same of a file's content. Throws Failure 66, 74 or 77 if it cannot be read.
std::string Sha256HexOfFile(const std::filesystem::path& path);

}  // namespace dreamsearch
