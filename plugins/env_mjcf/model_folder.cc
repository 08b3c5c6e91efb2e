#include "plugins/env_mjcf/model_folder.h"

#include <openssl/evp.h>

#include <array>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace dreamsearch::mjcf {
namespace {

using mujoco::EngineError;
using mujoco::FileReference;
using std::filesystem::path;

constexpr std::size_t kMostFiles = 10000;

std::string Sha256Hex(const std::string& bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned int size = 0;
  if (::EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, ::EVP_sha256(), nullptr) !=
      1) {
    throw EngineError("cannot compute a SHA-256");
  }
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    text += "0123456789abcdef"[digest[i] >> 4];
    text += "0123456789abcdef"[digest[i] & 15];
  }
  return text;
}

// Follows a model's references. Where the engine looks for a file depends on its version and on
// the compiler's settings, so every place where it might look must lie inside.
class Walk {
 public:
  explicit Walk(const path& model) : model_(model) {
    std::error_code error;
    folder_ = std::filesystem::canonical(model.parent_path(), error);
    if (error) Refuse("its folder cannot be read: " + error.message());
  }

  // SHA-256 of every file that it met but the model's own, by its path in the folder.
  std::map<std::string, std::string> Run() {
    const path own = std::filesystem::canonical(model_.parent_path()) / model_.filename();
    Visit(own);
    while (!found_all_) {
      found_all_ = true;
      // A folder or an included file that comes later widens where earlier names may lie.
      for (const auto& [attribute, value] : std::set(files_)) Follow(attribute, value);
    }
    digests_.erase(own.lexically_relative(folder_).string());
    return digests_;
  }

 private:
  [[noreturn]] void Refuse(const std::string& why) const {
    throw EngineError(model_.string() + ": " + why);
  }
  [[noreturn]] void RefuseReference(const std::string& attribute, const std::string& value,
                                    const std::string& why) const {
    Refuse("it refers to " + attribute + "=\"" + value + "\", " + why);
  }

  void Visit(const path& file) {
    if (!visited_.insert(file).second) return;
    if (visited_.size() > kMostFiles) {
      Refuse("it refers to more than " + std::to_string(kMostFiles) + " files");
    }
    std::ifstream stream(file, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    if (!stream) Refuse(file.string() + " cannot be read");
    found_all_ = false;
    digests_[file.lexically_relative(folder_).string()] = Sha256Hex(text);
    places_.insert(file.parent_path().lexically_relative(folder_));
    for (const FileReference& reference : mujoco::FileReferences(text)) {
      const auto& [attribute, value, is_folder] = reference;
      if (value.find_first_of("&\\:") != std::string::npos) {
        RefuseReference(attribute, value, "which has a character that hides where it leads");
      }
      if (path(value).is_absolute()) {
        RefuseReference(attribute, value, "an absolute path; expected one in the model's folder");
      }
      if (is_folder) {
        folders_.insert(value);
      } else if (value.empty()) {
        RefuseReference(attribute, value, "expected the name of a file in quotes");
      } else {
        files_.emplace(attribute, value);
      }
    }
    CheckMaterials(file, text);
  }

  // An OBJ file names its materials' files on lines of its own.
  void CheckMaterials(const path& file, const std::string& text) const {
    if (file.extension() != ".obj" && file.extension() != ".OBJ") return;
    for (auto at = text.find("mtllib"); at != std::string::npos; at = text.find("mtllib", at + 1)) {
      const std::string line = text.substr(at, text.find_first_of("\r\n", at) - at);
      if (line.find_first_of("/\\") == std::string::npos) continue;
      Refuse(file.string() + " refers to '" + line + "'; expected bare names of materials");
    }
  }

  void Follow(const std::string& attribute, const std::string& value) {
    bool exists = false;
    std::set<path> folders = folders_;
    folders.insert("");
    for (const path& place : std::set(places_)) {
      for (const path& folder : folders) {
        for (const path& name : {path(value), path(value).filename()}) {
          const path inside = (place / folder / name).lexically_normal();
          if (!inside.empty() && *inside.begin() == "..") {
            RefuseReference(attribute, value,
                            "which leads out of the model's folder " + folder_.string());
          }
          std::error_code error;
          const path real = std::filesystem::canonical(folder_ / inside, error);
          if (error || !std::filesystem::is_regular_file(real, error)) continue;
          const path relative = real.lexically_relative(folder_);
          if (relative.empty() || *relative.begin() == "..") {
            RefuseReference(attribute, value,
                            "a link that leads out of the model's folder " + folder_.string());
          }
          exists = true;
          Visit(folder_ / inside);
        }
      }
    }
    if (!exists) {
      RefuseReference(attribute, value, "and there is no such file in " + folder_.string());
    }
  }

  path model_;
  path folder_;
  std::set<path> visited_;
  std::set<path> places_;   // folders of the files visited, relative to folder_
  std::set<path> folders_;  // meshdir, texturedir, ...
  std::set<std::pair<std::string, std::string>> files_;
  std::map<std::string, std::string> digests_;
  bool found_all_ = false;
};

}  // namespace

FolderModel CompileInFolder(const path& model) {
  std::map<std::string, std::string> files = Walk(model).Run();
  return {mujoco::CompileFile(model.string()), std::move(files)};
}

}  // namespace dreamsearch::mjcf
