#include "host/saving/checkpoint.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <string_view>

#include "dreamsearch/version.h"
#include "dreamsearch_build_info.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/machine_fault.h"

namespace dreamsearch {
namespace {

constexpr std::string_view kMagic("DSCKPT\0", 7);
constexpr char kFormat = 2;
constexpr std::string_view kEnd = "DSCKPEND";
constexpr std::uint64_t kTailBytes = Sha256::kBytes + sizeof(std::uint64_t) + kEnd.size();
constexpr std::size_t kBlockBytes = 64 << 10;

// "0.1.0 (92d96c6be481)".
std::string ThisBuildText() {
  const std::string commit = DREAMSEARCH_BUILD_COMMIT;
  return std::string(DREAMSEARCH_VERSION) + " (" +
         (commit.empty() ? "unknown commit" : commit.substr(0, 12)) +
         (DREAMSEARCH_BUILD_DIRTY ? ", changed" : "") + ")";
}

template <typename Archive, typename Entry>
void VisitEntry(Archive* archive, Entry* entry) {
  (*archive)("part", &entry->name);
  (*archive)("version", &entry->version);
  (*archive)("bytes", &entry->bytes);
  (*archive)("sha256", &entry->sha256);
}

std::string Binary(const std::array<unsigned char, Sha256::kBytes>& digest) {
  return {digest.begin(), digest.end()};
}

}  // namespace

// --- writing -----------------------------------------------------------------

CheckpointWriter::CheckpointWriter(Append append) : append_(std::move(append)) {
  const std::string build = ThisBuildText();
  const auto length = static_cast<std::uint16_t>(build.size());
  std::string head(kMagic);
  head += kFormat;
  head.append(reinterpret_cast<const char*>(&length), sizeof length);
  head += build;
  frame_.Add(head);
  append_(head);
}

void CheckpointWriter::Part(const PartName& part,
                            const std::function<void(StateWriter* writer)>& write) {
  Entry entry{part.name, part.version, 0, ""};
  Sha256 sha256;
  StateWriter writer([&](std::string_view bytes) {
    sha256.Add(bytes);
    entry.bytes += bytes.size();
    append_(bytes);
  });
  write(&writer);
  writer.Flush();
  entry.sha256 = sha256.FinishHex();
  parts_.push_back(std::move(entry));
}

void CheckpointWriter::CopyParts(const Checkpoint& from, const PartName& but) {
  for (const Checkpoint::Entry& part : from.parts_) {
    if (part.name == but.name) continue;
    from.Verify(part);
    from.ReadBytes(part, append_);
    parts_.push_back({part.name, part.version, part.bytes, part.sha256});
  }
}

void CheckpointWriter::Finish() {
  std::string list;
  StateWriter writer([&](std::string_view bytes) { list.append(bytes); });
  const std::uint64_t count = parts_.size();
  writer("count", &count);
  for (const Entry& entry : parts_) VisitEntry(&writer, &entry);
  writer.Flush();
  frame_.Add(list);
  std::string tail = list + Binary(frame_.Finish());
  const std::uint64_t bytes = list.size();
  tail.append(reinterpret_cast<const char*>(&bytes), sizeof bytes);
  tail += kEnd;
  append_(tail);
}

WrittenFile WriteCheckpointFile(const std::filesystem::path& path,
                                const std::function<void(CheckpointWriter* writer)>& write) {
  WrittenFile written;
  written.path = path;
  Sha256 sha256;
  WriteWholeFile(path, [&](const Append& append) {
    CheckpointWriter writer([&](std::string_view bytes) {
      sha256.Add(bytes);
      written.bytes += bytes.size();
      append(bytes);
    });
    write(&writer);
    writer.Finish();
  });
  written.sha256 = sha256.FinishHex();
  return written;
}

// --- reading -----------------------------------------------------------------

Checkpoint::Checkpoint(const std::filesystem::path& path)
    : path_(std::filesystem::absolute(path)),
      file_(::open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {
  if (file_.get() < 0) {
    const bool missing = errno == ENOENT || errno == ENOTDIR;
    throw Failure(missing           ? ExitCode::kNotFound
                  : errno == EACCES ? ExitCode::kPermission
                                    : ExitCode::kInputOutput,
                  "no checkpoint " + path_.string() + " to read: " + std::strerror(errno));
  }
  struct stat status;
  if (::fstat(file_.get(), &status) != 0 || !S_ISREG(status.st_mode)) {
    Damaged("it is no regular file");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
  ReadFrame();
}

void Checkpoint::Damaged(const std::string& what) const {
  throw Failure(ExitCode::kBadInput, "damaged checkpoint " + path_.string() + ": " + what +
                                         "; put a whole copy of it back");
}

std::string Checkpoint::Advice() const {
  return "It was written by runner " + build_ + ", this is runner " + ThisBuildText() +
         ": resume with that one, or start the run over (its command with --retry --replace)";
}

void Checkpoint::ReadAt(std::uint64_t offset, void* data, std::uint64_t size) const {
  auto* to = static_cast<char*>(data);
  while (size > 0) {
    const ssize_t got = ::pread(file_.get(), to, size, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      throw Failure(ExitCode::kInputOutput,
                    path_.string() + ": cannot be read: " + std::strerror(errno));
    }
    if (got == 0) Damaged("cut off at byte " + std::to_string(offset));
    to += got;
    offset += static_cast<std::uint64_t>(got);
    size -= static_cast<std::uint64_t>(got);
  }
}

// Magic, build and list of parts.
void Checkpoint::ReadFrame() {
  const auto take = [&](std::uint64_t offset, std::uint64_t size) {
    if (offset > size_ || size > size_ - offset) Damaged("cut off");
    std::string bytes(size, '\0');
    ReadAt(offset, bytes.data(), size);
    return bytes;
  };
  std::string head = take(0, kMagic.size() + 1);
  if (!head.starts_with(kMagic)) {
    throw Failure(ExitCode::kBadInput, path_.string() +
                                           " is no checkpoint: expected a file that begins with "
                                           "DSCKPT");
  }
  if (head.back() != kFormat) {
    const int format = static_cast<unsigned char>(head.back());
    throw Failure(ExitCode::kBadInput,
                  path_.string() + " is a checkpoint of format " + std::to_string(format) +
                      ", of another runner; this is runner " + ThisBuildText() +
                      ", which reads format " + std::to_string(kFormat) +
                      ". Resume with the runner that wrote it, or start the run over (its command "
                      "with --retry --replace)");
  }
  std::uint16_t length = 0;
  const std::string length_bytes = take(head.size(), sizeof length);
  std::memcpy(&length, length_bytes.data(), sizeof length);
  build_ = take(head.size() + sizeof length, length);
  head += length_bytes + build_;

  if (size_ < head.size() + kTailBytes) Damaged("cut off");
  const std::string tail = take(size_ - kTailBytes, kTailBytes);
  if (!tail.ends_with(kEnd)) Damaged("it does not end as a checkpoint does: cut off");
  std::uint64_t list_bytes = 0;
  std::memcpy(&list_bytes, tail.data() + Sha256::kBytes, sizeof list_bytes);
  const std::uint64_t most = size_ - kTailBytes - head.size();
  if (list_bytes > most) Damaged("its list of parts is longer than the file");
  const std::uint64_t list_offset = size_ - kTailBytes - list_bytes;
  const std::string list = take(list_offset, list_bytes);
  Sha256 frame;
  frame.Add(head);
  frame.Add(list);
  if (Binary(frame.Finish()) != tail.substr(0, Sha256::kBytes)) {
    Damaged("the checksum of its list of parts does not match");
  }

  std::uint64_t position = 0;
  StateReader reader(
      [&](void* data, std::uint64_t size) {
        std::memcpy(data, list.data() + position, size);
        position += size;
      },
      list.size(), path_.string() + ", list of parts", Advice());
  std::uint64_t count = 0;
  reader("count", &count);
  std::uint64_t offset = head.size();
  for (std::uint64_t i = 0; i < count; ++i) {
    Entry entry;
    VisitEntry(&reader, &entry);
    entry.offset = offset;
    if (entry.bytes > list_offset - offset) Damaged("part '" + entry.name + "' is cut off");
    offset += entry.bytes;
    parts_.push_back(std::move(entry));
  }
  reader.Finish();
  if (offset != list_offset) Damaged("there are bytes that belong to no part");
}

bool Checkpoint::Has(const PartName& part) const {
  return std::any_of(parts_.begin(), parts_.end(),
                     [&](const Entry& entry) { return entry.name == part.name; });
}

void Checkpoint::Verify() const {
  for (const Entry& entry : parts_) Verify(entry);
}

void Checkpoint::Verify(const Entry& entry) const {
  if (entry.verified) return;
  Sha256 sha256;
  ReadBytes(entry, [&](std::string_view bytes) { sha256.Add(bytes); });
  if (sha256.FinishHex() != entry.sha256) {
    Damaged("the checksum of part '" + entry.name + "' does not match");
  }
  entry.verified = true;
}

void Checkpoint::ReadBytes(const Entry& entry, const Append& append) const {
  std::string block(kBlockBytes, '\0');
  for (std::uint64_t done = 0; done < entry.bytes;) {
    const std::uint64_t size = std::min<std::uint64_t>(entry.bytes - done, block.size());
    ReadAt(entry.offset + done, block.data(), size);
    append({block.data(), size});
    done += size;
  }
}

void Checkpoint::Read(const PartName& part,
                      const std::function<void(StateReader* reader)>& read) const {
  const auto found = std::find_if(parts_.begin(), parts_.end(),
                                  [&](const Entry& entry) { return entry.name == part.name; });
  if (found == parts_.end()) {
    throw Failure(ExitCode::kBadInput, path_.string() + ": expected a part '" + part.name +
                                           "', found none. " + Advice());
  }
  Verify(*found);
  const std::string where = path_.string() + ", part '" + part.name + "'";
  if (found->version != part.version) {
    throw Failure(ExitCode::kBadInput, where + ": expected version " +
                                           std::to_string(part.version) + ", found " +
                                           std::to_string(found->version) + ". " + Advice());
  }
  std::uint64_t offset = found->offset;
  StateReader reader(
      [&](void* data, std::uint64_t size) {
        ReadAt(offset, data, size);
        offset += size;
      },
      found->bytes, where, Advice());
  read(&reader);
  reader.Finish();
}

std::string Checkpoint::StreamSha256(const PartName& part, const char* field) const {
  Sha256 sha256;
  Read(part, [&](StateReader* reader) {
    reader->Stream(field, [&](std::string_view bytes) { sha256.Add(bytes); });
  });
  return sha256.FinishHex();
}

// --- a run's folder ----------------------------------------------------------

std::vector<CheckpointFolder::Found> CheckpointFolder::List() const {
  std::vector<Found> found;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, ignored)) {
    std::uint64_t env_step = 0;
    int length = 0;
    const std::string name = entry.path().filename().string();
    if (std::sscanf(name.c_str(), "checkpoint-%" SCNu64 ".ckpt%n", &env_step, &length) == 1 &&
        length == static_cast<int>(name.size())) {
      found.push_back({env_step, entry.path()});
    }
  }
  std::sort(found.begin(), found.end(),
            [](const Found& a, const Found& b) { return a.env_step > b.env_step; });
  return found;
}

std::filesystem::path CheckpointFolder::PathOf(std::uint64_t env_step) const {
  return folder_ / ("checkpoint-" + std::to_string(env_step) + ".ckpt");
}

WrittenFile CheckpointFolder::Write(std::uint64_t env_step,
                                    const std::function<void(CheckpointWriter* writer)>& write,
                                    std::uint64_t before) {
  WrittenFile written = WriteCheckpointFile(PathOf(env_step), write);
  RemoveUnfinished();
  // One that took the place of its like was reached from what that was reached from.
  if (before == env_step) return written;
  for (const Found& found : List()) {
    if (found.env_step >= env_step || found.env_step == before) continue;
    std::error_code ignored;
    std::filesystem::remove(found.path, ignored);
  }
  return written;
}

// What processes that ended while they wrote a checkpoint have left.
void CheckpointFolder::RemoveUnfinished() const {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("checkpoint-") || !name.ends_with(kTemporarySuffix)) continue;
    const std::size_t end = name.find(".ckpt.");
    if (end == std::string::npos) continue;
    if (IsTemporaryOf(entry.path(), folder_ / name.substr(0, end + 5))) {
      std::filesystem::remove(entry.path(), ignored);
    }
  }
}

std::optional<CheckpointFolder::Loaded> CheckpointFolder::LoadNewest(const Judge& judge,
                                                                     Extent extent) const {
  std::vector<Skipped> skipped;
  for (const Found& found : List()) {
    try {
      Checkpoint checkpoint(found.path);
      if (extent == Extent::kWhole) checkpoint.Verify();
      const std::string why = judge ? judge(checkpoint) : "";
      if (why.empty()) return Loaded{std::move(checkpoint), std::move(skipped)};
      skipped.push_back({false, checkpoint.path().string() + " " + why});
    } catch (const Failure& error) {
      // What cannot be read today may be whole: an older one in its place would cost its rows.
      if (IsOfTheMachine(error.code())) throw;
      skipped.push_back({true, error.what()});
    }
  }
  if (skipped.empty()) return std::nullopt;
  std::string message = "no whole checkpoint";
  if (judge) message += " that continues the run";
  message += " is left in " + std::filesystem::absolute(folder_).string();
  for (const Skipped& one : skipped) message += "\n  " + one.why;
  throw Failure(ExitCode::kBadInput, message);
}

}  // namespace dreamsearch
