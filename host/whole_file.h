// whole_file.h - writes an output file whole or not at all.
#pragma once

#include <filesystem>
#include <string>

namespace dreamsearch {

// Writes under a temporary name beside it, then renames; a file of that name is
// replaced. Throws RunnerError 73, 74 or 77 with the path, and then changed nothing.
void WriteWholeFile(const std::filesystem::path& path, const std::string& bytes);

}  // namespace dreamsearch
