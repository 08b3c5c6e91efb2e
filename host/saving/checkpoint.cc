#include "host/saving/checkpoint.h"

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string_view>

#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/sha256.h"

namespace dreamsearch {
namespace {

constexpr char kMagic[8] = {'D', 'S', 'C', 'K', 'P', 'T', '\0', '\1'};
constexpr char kEnd[] = "end";

using Digest = std::array<unsigned char, Sha256::kBytes>;

Digest SectionDigest(const std::string& name, const char* data, std::size_t size) {
  Sha256 sha256;
  sha256.Add(name);
  sha256.Add(std::string_view("", 1));
  sha256.Add({data, size});
  return sha256.Finish();
}

}  // namespace

void WriteCheckpointFile(const std::filesystem::path& path, const CheckpointSections& sections) {
  WriteWholeFile(path, [&](const Append& append) {
    const auto append_section = [&](const std::string& name, const std::string& data) {
      const std::uint64_t name_size = name.size(), data_size = data.size();
      const Digest digest = SectionDigest(name, data.data(), data.size());
      std::string head;
      head.append(reinterpret_cast<const char*>(&name_size), sizeof name_size);
      head.append(name);
      head.append(reinterpret_cast<const char*>(&data_size), sizeof data_size);
      head.append(reinterpret_cast<const char*>(digest.data()), digest.size());
      append(head);
      append(data);
    };
    append({kMagic, sizeof kMagic});
    for (const auto& [name, data] : sections) append_section(name, data);
    append_section(kEnd, "");
  });
}

CheckpointSections ReadCheckpointFile(const std::filesystem::path& path,
                                      const SectionFilter& wanted) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw Failure(ExitCode::kNotFound, "no checkpoint " + std::filesystem::absolute(path).string());
  }
  std::error_code error;
  const std::uint64_t file_size = std::filesystem::file_size(path, error);
  std::uint64_t position = 0;
  const auto damaged = [&](const std::string& what) {
    return Failure(ExitCode::kBadInput, "damaged checkpoint " +
                                            std::filesystem::absolute(path).string() + ": " + what +
                                            " at byte " + std::to_string(position));
  };
  if (error) throw damaged(error.message());
  const auto advance = [&](std::uint64_t size) {
    if (size > file_size - position) throw damaged("cut off");
    position += size;
  };
  const auto take = [&](std::uint64_t size) {
    advance(size);
    std::string bytes(size, '\0');
    if (!file.read(bytes.data(), static_cast<std::streamsize>(size))) throw damaged("unreadable");
    return bytes;
  };
  const auto take_size = [&] {
    std::uint64_t size;
    std::memcpy(&size, take(sizeof size).data(), sizeof size);
    return size;
  };
  if (take(sizeof kMagic) != std::string_view(kMagic, sizeof kMagic)) {
    throw damaged("not a checkpoint of this format version");
  }
  CheckpointSections sections;
  for (;;) {
    const std::string name = take(take_size());
    const std::uint64_t data_size = take_size();
    const std::string digest = take(Sha256::kBytes);
    if (wanted && name != kEnd && !wanted(name)) {
      advance(data_size);
      file.seekg(static_cast<std::streamoff>(position));
      continue;
    }
    std::string data = take(data_size);
    const Digest found = SectionDigest(name, data.data(), data.size());
    if (std::memcmp(digest.data(), found.data(), found.size()) != 0) {
      throw damaged("checksum of section '" + name + "' does not match");
    }
    if (name == kEnd) break;
    sections[name] = std::move(data);
  }
  if (position != file_size) throw damaged("bytes after the end");
  return sections;
}

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

std::filesystem::path CheckpointFolder::Write(std::uint64_t env_step,
                                              const CheckpointSections& sections,
                                              std::uint64_t before) {
  const std::filesystem::path path = PathOf(env_step);
  WriteCheckpointFile(path, sections);
  // One that took the place of its like was reached from what that was reached from.
  if (before == env_step) return path;
  for (const Found& found : List()) {
    if (found.env_step >= env_step || found.env_step == before) continue;
    std::error_code ignored;
    std::filesystem::remove(found.path, ignored);
  }
  return path;
}

std::optional<CheckpointFolder::Loaded> CheckpointFolder::LoadNewest(
    const Judge& judge, const SectionFilter& wanted) const {
  std::vector<Skipped> skipped;
  for (const Found& found : List()) {
    try {
      CheckpointSections sections = ReadCheckpointFile(found.path, wanted);
      const std::string why = judge ? judge(sections) : "";
      if (why.empty()) return Loaded{found.path, std::move(sections), std::move(skipped)};
      skipped.push_back({false, std::filesystem::absolute(found.path).string() + " " + why});
    } catch (const Failure& error) {
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
