#include "checkpoint.h"

#include <openssl/sha.h>

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>

#include "error.h"
#include "whole_file.h"

namespace dreamsearch {
namespace {

constexpr char kMagic[8] = {'D', 'S', 'C', 'K', 'P', 'T', '\0', '\1'};
constexpr char kEnd[] = "end";

using Digest = std::array<unsigned char, SHA256_DIGEST_LENGTH>;

Digest SectionDigest(const std::string& name, const char* data, std::size_t size) {
  Digest digest;
  std::string framed = name;
  framed.push_back('\0');
  framed.append(data, size);
  SHA256(reinterpret_cast<const unsigned char*>(framed.data()), framed.size(), digest.data());
  return digest;
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

CheckpointSections ReadCheckpointFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw RunnerError(ExitCode::kNotFound,
                      "no checkpoint " + std::filesystem::absolute(path).string());
  }
  std::stringstream buffer;
  buffer << file.rdbuf();
  const std::string bytes = std::move(buffer).str();
  std::size_t position = 0;
  const auto damaged = [&](const std::string& what) {
    return RunnerError(ExitCode::kBadInput,
                       "damaged checkpoint " + std::filesystem::absolute(path).string() + ": " +
                           what + " at byte " + std::to_string(position));
  };
  const auto take = [&](std::uint64_t size) {
    if (size > bytes.size() - position) throw damaged("cut off");
    const char* at = bytes.data() + position;
    position += size;
    return at;
  };
  const auto take_size = [&] {
    std::uint64_t size;
    std::memcpy(&size, take(sizeof size), sizeof size);
    return size;
  };
  if (std::memcmp(take(sizeof kMagic), kMagic, sizeof kMagic) != 0) {
    throw damaged("not a checkpoint of this format version");
  }
  CheckpointSections sections;
  for (;;) {
    const std::uint64_t name_size = take_size();
    const char* name_data = take(name_size);
    const std::string name(name_data, name_size);
    const std::uint64_t data_size = take_size();
    const char* digest = take(SHA256_DIGEST_LENGTH);
    const char* data = take(data_size);
    const Digest found = SectionDigest(name, data, data_size);
    if (std::memcmp(digest, found.data(), found.size()) != 0) {
      throw damaged("checksum of section '" + name + "' does not match");
    }
    if (name == kEnd) break;
    sections[name] = std::string(data, data_size);
  }
  if (position != bytes.size()) throw damaged("bytes after the end");
  return sections;
}

std::vector<std::filesystem::path> CheckpointFolder::List() const {
  std::vector<std::pair<std::uint64_t, std::filesystem::path>> found;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, ignored)) {
    std::uint64_t env_step = 0;
    int length = 0;
    const std::string name = entry.path().filename().string();
    if (std::sscanf(name.c_str(), "checkpoint-%" SCNu64 ".ckpt%n", &env_step, &length) == 1 &&
        length == static_cast<int>(name.size())) {
      found.emplace_back(env_step, entry.path());
    }
  }
  std::sort(found.begin(), found.end(), std::greater<>());
  std::vector<std::filesystem::path> paths;
  for (auto& [env_step, path] : found) paths.push_back(std::move(path));
  return paths;
}

std::filesystem::path CheckpointFolder::PathOf(std::uint64_t env_step) const {
  return folder_ / ("checkpoint-" + std::to_string(env_step) + ".ckpt");
}

std::filesystem::path CheckpointFolder::Write(std::uint64_t env_step,
                                              const CheckpointSections& sections) {
  const std::filesystem::path path = PathOf(env_step);
  WriteCheckpointFile(path, sections);
  const std::vector<std::filesystem::path> all = List();
  for (std::size_t i = 2; i < all.size(); ++i) {
    std::error_code ignored;
    std::filesystem::remove(all[i], ignored);
  }
  return path;
}

std::optional<CheckpointFolder::Loaded> CheckpointFolder::LoadNewest() const {
  std::vector<std::string> skipped;
  for (const std::filesystem::path& path : List()) {
    try {
      CheckpointSections sections = ReadCheckpointFile(path);
      return Loaded{path, std::move(sections), std::move(skipped)};
    } catch (const RunnerError& error) {
      skipped.push_back(error.what());
    }
  }
  if (skipped.empty()) return std::nullopt;
  std::string message = "no whole checkpoint is left; start over with --retry --replace.";
  for (const std::string& why : skipped) message += "\n  " + why;
  throw RunnerError(ExitCode::kBadInput, message);
}

}  // namespace dreamsearch
