// checkpoint.h - a run's state on disk, safe against being cut off anywhere.
//
// A checkpoint is a file of parts, each with a name, a version and named fields (state.h).
// It is written under a temporary name, synced, renamed and its folder synced; the last two
// are kept. Each part carries its SHA-256, so that the newest checkpoint that is whole is
// found even if a later one was torn. Digests are computed while the bytes pass by: nothing
// is held in memory or read again for them.
//
// Layout (little-endian): magic "DSCKPT\0" and u8 2, the format; u16 length and text of the
// runner's build; the parts, one after the other; the list of parts, as fields: their number,
// and of each name, version, bytes and SHA-256; 32 bytes SHA-256 of all but the parts
// before it; u64 bytes of the list; magic "DSCKPEND".
//
// A change of a part's fields raises its version. Nothing reads other versions: the runner
// that wrote a checkpoint goes on with it.
//
// Errors   Failure 65 for what is no checkpoint, damaged, of another format or version, or
//          has other fields than expected, and 66 if there is no such file: with path, part
//          and field, and what to do. When writing 73, 74 or 77, with the path and the free
//          space; then no file of that name was changed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/saving/state.h"
#include "results/system/file_descriptor.h"
#include "results/system/sha256.h"

namespace dreamsearch {

struct PartName {
  const char* name;
  std::uint32_t version;
};

// Of what run a checkpoint is; its part kHeaderPart.
struct CheckpointHeader {
  std::string run;            // UUID
  std::string configuration;  // its SHA-256
  std::uint64_t seed = 0;
  std::string instruction_set;
  std::map<std::string, std::string> plugins;  // DigestsOf its run

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("run", &run);
    (*archive)("configuration", &configuration);
    (*archive)("seed", &seed);
    (*archive)("instruction_set", &instruction_set);
    VisitMap(archive, "plugins", &plugins);
  }
};
inline constexpr PartName kHeaderPart{"header", 1};

class Checkpoint;

// Writes the parts of one file, each once.
class CheckpointWriter {
 public:
  // `append` receives the bytes of the file.
  explicit CheckpointWriter(Append append);

  void Part(const PartName& part, const std::function<void(StateWriter* writer)>& write);
  // A part that is one value's Fields.
  template <typename T>
  void Value(const PartName& part, T value) {
    Part(part, [&](StateWriter* writer) { value.Fields(writer); });
  }
  // Every part of another file but that one, as it lies there.
  void CopyParts(const Checkpoint& from, const PartName& but);
  // The list of parts; comes last.
  void Finish();

 private:
  struct Entry {
    std::string name;
    std::uint32_t version;
    std::uint64_t bytes;
    std::string sha256;
  };

  Append append_;
  Sha256 frame_;
  std::vector<Entry> parts_;
};

struct WrittenFile {
  std::filesystem::path path;
  std::uint64_t bytes = 0;
  std::string sha256;  // of the whole file
};
WrittenFile WriteCheckpointFile(const std::filesystem::path& path,
                                const std::function<void(CheckpointWriter* writer)>& write);

// A checkpoint file, open: what it holds stays the same, whatever becomes of its name.
// Threads  any number may read at once, once it was verified.
class Checkpoint {
 public:
  // Reads and checks all but the parts.
  explicit Checkpoint(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return path_; }  // absolute
  bool Has(const PartName& part) const;
  // Checks the digest of every part.
  void Verify() const;

  // Hands over a part, verified. Refuses one of another version, and fields that are left.
  void Read(const PartName& part, const std::function<void(StateReader* reader)>& read) const;
  template <typename T>
  T Value(const PartName& part) const {
    T value;
    Read(part, [&](StateReader* reader) { value.Fields(reader); });
    return value;
  }
  // SHA-256, in hexadecimal, of what the only stream of a part holds.
  std::string StreamSha256(const PartName& part, const char* field) const;

 private:
  friend class CheckpointWriter;  // it copies parts
  struct Entry {
    std::string name;
    std::uint32_t version = 0;
    std::uint64_t bytes = 0;
    std::string sha256;
    std::uint64_t offset = 0;
    mutable bool verified = false;
  };
  void ReadFrame();
  void Verify(const Entry& entry) const;
  // A part's bytes, a block at a time.
  void ReadBytes(const Entry& entry, const Append& append) const;
  void ReadAt(std::uint64_t offset, void* data, std::uint64_t size) const;
  [[noreturn]] void Damaged(const std::string& what) const;
  std::string Advice() const;

  std::filesystem::path path_;
  FileDescriptor file_;
  std::uint64_t size_ = 0;
  std::string build_;
  std::vector<Entry> parts_;
};

// The checkpoints of one run: files `checkpoint-<env_step>.ckpt` in its folder.
class CheckpointFolder {
 public:
  explicit CheckpointFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::filesystem::path PathOf(std::uint64_t env_step) const;

  // Writes one and removes those of fewer steps but the one at `before`, from which
  // this one was reached, and what writers that were killed have left. Who calls this holds the
  // run's lock. Those of more steps are another process's or remade later: they
  // stay.
  WrittenFile Write(std::uint64_t env_step,
                    const std::function<void(CheckpointWriter* writer)>& write,
                    std::uint64_t before);

  // One that was passed over, and why.
  struct Skipped {
    bool damaged = false;  // otherwise whole, but of no use to who asked
    std::string why;
  };
  struct Loaded {
    Checkpoint checkpoint;
    std::vector<Skipped> skipped;  // newer ones
  };
  // Why a whole checkpoint is of no use; empty if it is the one.
  using Judge = std::function<std::string(const Checkpoint& checkpoint)>;
  // kOutline: what the judge does not read of a checkpoint is not verified.
  enum class Extent { kOutline, kWhole };
  // The newest that is whole and that `judge` lets through; nullopt if there is none at
  // all. Throws Failure 65, with the reasons, if there are some and none will do.
  std::optional<Loaded> LoadNewest(const Judge& judge = {}, Extent extent = Extent::kWhole) const;

 private:
  struct Found {
    std::uint64_t env_step;
    std::filesystem::path path;
  };
  // Newest first.
  std::vector<Found> List() const;
  void RemoveUnfinished() const;

  std::filesystem::path folder_;
};

}  // namespace dreamsearch
