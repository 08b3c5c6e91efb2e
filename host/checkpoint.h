// checkpoint.h - a run's state on disk, safe against being cut off anywhere.
//
// A checkpoint is a file of named sections. It is written under a temporary
// name, synced, renamed and its folder synced; the last two are kept. Each
// section carries its SHA-256, so that the newest checkpoint that is whole is
// found even if a later one was torn.
//
// Layout (little-endian): magic "DSCKPT\0\1", then for each section: u64 name
// length, name, u64 data length, 32 bytes SHA-256 of name and data, data; last a
// section named "end" that is empty.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace dreamsearch {

using CheckpointSections = std::map<std::string, std::string>;

// Writes a file as described above. Throws RunnerError 73, 74 or 77 with the path
// and the free space; then no file of that name was changed.
void WriteCheckpointFile(const std::filesystem::path& path, const CheckpointSections& sections);

// Throws RunnerError 65 with what is wrong, 66 if there is no such file.
CheckpointSections ReadCheckpointFile(const std::filesystem::path& path);

// The checkpoints of one run: files `checkpoint-<env_step>.ckpt` in its folder.
class CheckpointFolder {
 public:
  explicit CheckpointFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::filesystem::path PathOf(std::uint64_t env_step) const;

  // Writes one and removes all but the last two. Returns its path.
  std::filesystem::path Write(std::uint64_t env_step, const CheckpointSections& sections);

  struct Loaded {
    std::filesystem::path path;
    CheckpointSections sections;
    std::vector<std::string> skipped;  // newer ones that were damaged, and why
  };
  // The newest whole one; nullopt if there is none at all. Throws if there are
  // some and all are damaged.
  std::optional<Loaded> LoadNewest() const;

 private:
  // Paths, newest first.
  std::vector<std::filesystem::path> List() const;

  std::filesystem::path folder_;
};

}  // namespace dreamsearch
