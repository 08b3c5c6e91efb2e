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
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace dreamsearch {

using CheckpointSections = std::map<std::string, std::string>;

// Writes a file as described above. Throws Failure 73, 74 or 77 with the path
// and the free space; then no file of that name was changed.
void WriteCheckpointFile(const std::filesystem::path& path, const CheckpointSections& sections);

// Which sections to read; the others are passed over, unchecked.
using SectionFilter = std::function<bool(const std::string& name)>;

// Throws Failure 65 with what is wrong, 66 if there is no such file. All sections
// unless `wanted` is given.
CheckpointSections ReadCheckpointFile(const std::filesystem::path& path,
                                      const SectionFilter& wanted = {});

// The checkpoints of one run: files `checkpoint-<env_step>.ckpt` in its folder.
class CheckpointFolder {
 public:
  explicit CheckpointFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::filesystem::path PathOf(std::uint64_t env_step) const;

  // Writes one and removes those of fewer steps but the one at `before`, from which
  // this one was reached. Those of more steps are another process's or remade later: they
  // stay. Returns its path.
  std::filesystem::path Write(std::uint64_t env_step, const CheckpointSections& sections,
                              std::uint64_t before);

  // One that was passed over, and why.
  struct Skipped {
    bool damaged = false;  // otherwise whole, but of no use to who asked
    std::string why;
  };
  struct Loaded {
    std::filesystem::path path;
    CheckpointSections sections;
    std::vector<Skipped> skipped;  // newer ones
  };
  // Why a whole checkpoint is of no use; empty if it is the one.
  using Judge = std::function<std::string(const CheckpointSections& sections)>;
  // The newest that is whole and that `judge` lets through, with the sections `wanted`;
  // nullopt if there is none at all. Throws Failure 65, with the reasons, if there are
  // some and none will do.
  std::optional<Loaded> LoadNewest(const Judge& judge = {}, const SectionFilter& wanted = {}) const;

 private:
  struct Found {
    std::uint64_t env_step;
    std::filesystem::path path;
  };
  // Newest first.
  std::vector<Found> List() const;

  std::filesystem::path folder_;
};

}  // namespace dreamsearch
