// fuzz.h - changed bytes, and the targets that read them; see fuzz.cc.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>

#include "dreamsearch/random.h"

namespace dreamsearch {

// A file in memory, with a path.
class MemoryPath {
 public:
  MemoryPath() : file_(::memfd_create("fuzz", MFD_CLOEXEC)) {}
  std::string Holding(const std::string& bytes) const {
    if (::ftruncate(file_, 0) != 0 || ::pwrite(file_, bytes.data(), bytes.size(), 0) < 0) {
      std::abort();
    }
    return "/proc/self/fd/" + std::to_string(file_);
  }

 private:
  int file_;
};

// A copy with a few changes: bits, bytes, lengths, words, pieces moved or left out.
std::string Changed(std::string bytes, Random* random);

// One execution: reads something changed. May throw Failure.
using Target = std::function<void(Random* random)>;
const std::map<std::string, Target (*)()>& Targets();

// How often a target refused what it read.
inline std::uint64_t refusals = 0;

}  // namespace dreamsearch
