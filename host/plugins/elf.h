// elf.h - looks at a file before the dynamic loader does.
//
// dlopen of a truncated library dies with SIGBUS, and of anything else that is
// not a library it reports misleading texts. So the header, every segment and
// every section are checked against the file's size first.
#pragma once

#include <filesystem>

namespace dreamsearch {

// Throws Failure unless `file` is a complete shared library for the machine
// this program runs on:
//   kNotFound       no such file.
//   kPermission     it cannot be read.
//   kPluginRefused  a folder, empty, text, not ELF, 32-bit, of another machine,
//                   not a shared object, or cut short; the message says which.
void CheckSharedLibrary(const std::filesystem::path& file);

}  // namespace dreamsearch
