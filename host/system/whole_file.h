// whole_file.h - writes a file of the host's own whole or not at all.
//
// For what a run must find again after a crash or a power cut: it is written under a
// temporary name, synced, renamed, and its folder synced. An output that the user
// named is results::OutputFile's.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace dreamsearch {

// `write` hands over the bytes, piece by piece. Throws RunnerError 73, 74 or 77 with the
// path and the free space; then no file of that name was changed.
using Append = std::function<void(std::string_view bytes)>;
void WriteWholeFile(const std::filesystem::path& path,
                    const std::function<void(const Append& append)>& write);
void WriteWholeFile(const std::filesystem::path& path, const std::string& bytes);

}  // namespace dreamsearch
