// compressed.h - files that came compressed.
#pragma once

#include <string>

namespace dreamsearch {

// What a gzip file holds, or the bytes themselves if they are not of a compressed file.
//   Failure 65  a gzip file that is damaged or holds more than 1 GB, and every other kind of
//               compressed file; the message has the command that unpacks it.
std::string Unpacked(const std::string& path, const std::string& bytes);

}  // namespace dreamsearch
