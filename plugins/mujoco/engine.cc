#include "plugins/mujoco/engine.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <map>
#include <mutex>

namespace dreamsearch::mujoco {
namespace {

void ThrowEngineError(const char* message) { throw EngineError(message); }
void IgnoreEngineWarning(const char*) {}  // mjData.warning counts it

bool IsAmong(std::span<const ModelFile> files, std::string_view name) {
  return std::ranges::any_of(files, [name](const ModelFile& file) { return file.name == name; });
}

bool IsNameCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == ':';
}

void CheckFileReferences(const std::string& name, std::string_view mjcf,
                         std::span<const ModelFile> files) {
  for (const FileReference& reference : FileReferences(mjcf)) {
    if (reference.folder || !IsAmong(files, reference.value)) {
      throw EngineError("model '" + name + "' refers to " + reference.attribute + "=\"" +
                        reference.value +
                        "\"; it may refer only to the plugin's own model files, by bare name");
    }
  }
}

struct VfsDeleter {
  void operator()(mjVFS* vfs) const {
    mj_deleteVFS(vfs);
    delete vfs;
  }
};
using VfsPtr = std::unique_ptr<mjVFS, VfsDeleter>;

void AddFile(mjVFS* vfs, const std::string& file, std::string_view text) {
  if (text.empty()) throw EngineError("'" + file + "' is empty");
#if mjVERSION_HEADER >= 300
  if (mj_addBufferVFS(vfs, file.c_str(), text.data(), static_cast<int>(text.size())) != 0) {
    throw EngineError("cannot hold '" + file + "' in memory");
  }
#else
  if (mj_makeEmptyFileVFS(vfs, file.c_str(), static_cast<int>(text.size())) != 0) {
    throw EngineError("cannot hold '" + file + "' in memory");
  }
  std::memcpy(vfs->filedata[mj_findFileVFS(vfs, file.c_str())], text.data(), text.size());
#endif
}

// `files`, for the engine to find by name.
VfsPtr FilesInMemory(std::span<const ModelFile> files) {
  VfsPtr vfs(new mjVFS);
  mj_defaultVFS(vfs.get());
  for (const ModelFile& file : files) AddFile(vfs.get(), std::string(file.name), file.bytes);
  return vfs;
}

}  // namespace

void InstallEngineHandlers() {
  static std::once_flag once;
  std::call_once(once, [] {
    mju_user_error = ThrowEngineError;
    mju_user_warning = IgnoreEngineWarning;
  });
}

std::vector<FileReference> FileReferences(std::string_view mjcf) {
  std::vector<FileReference> references;
  for (std::size_t i = mjcf.find('='); i != std::string::npos; i = mjcf.find('=', i + 1)) {
    std::size_t end = i;
    while (end > 0 && std::isspace(static_cast<unsigned char>(mjcf[end - 1]))) --end;
    std::size_t begin = end;
    while (begin > 0 && IsNameCharacter(mjcf[begin - 1])) --begin;
    const std::string attribute(mjcf.substr(begin, end - begin));
    const bool is_file = attribute.starts_with("file");  // file, fileup, ..., filename
    const bool is_folder = attribute.size() > 3 && attribute.ends_with("dir");  // meshdir, ...
    if (!is_file && !is_folder) continue;
    std::size_t open = i + 1;
    while (open < mjcf.size() && std::isspace(static_cast<unsigned char>(mjcf[open]))) ++open;
    std::string value;
    if (open < mjcf.size() && (mjcf[open] == '"' || mjcf[open] == '\'')) {
      value = mjcf.substr(open + 1, mjcf.find(mjcf[open], open + 1) - open - 1);
    }
    references.push_back({attribute, value, is_folder});
  }
  return references;
}

ModelPtr CompileFile(const std::string& path) {
  InstallEngineHandlers();
  char error[1000] = "";
  std::string reason;
  try {
    ModelPtr model(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
    if (model != nullptr) return model;
    reason = error;
  } catch (const EngineError& raised) {
    reason = raised.what();
  }
  std::string message =
      path + " does not compile with MuJoCo " + mj_versionString() + ": " + reason;
#if mjVERSION_HEADER < 300
  if (reason.find("unrecognized") != std::string::npos) {
    message +=
        ". A model for MuJoCo 3 is a task of the plugin env_mjcf3, --env mjcf3:NAME "
        "(plugins/env_mjcf/README.md, \"Models of today\")";
  }
#endif
  throw EngineError(message);
}

ModelPtr CompileModel(const std::string& name, std::string_view mjcf,
                      std::span<const ModelFile> files) {
  InstallEngineHandlers();
  CheckFileReferences(name, mjcf, files);

  char error[1000] = "";
  try {
    const VfsPtr vfs = FilesInMemory(files);
    const std::string root = "model:" + name;  // no file has a colon
    AddFile(vfs.get(), root, mjcf);
    ModelPtr model(mj_loadXML(root.c_str(), vfs.get(), error, sizeof error));
    if (model != nullptr) return model;
  } catch (const EngineError& raised) {
    throw EngineError("model '" + name + "' does not compile: " + raised.what());
  }
  throw EngineError("model '" + name + "' does not compile: " + error);
}

ModelPtr CopyOfCompiled(const std::string& name, std::string_view mjcf,
                        std::span<const ModelFile> files) {
  static std::mutex mutex;
  static std::map<std::string, ModelPtr> compiled;
  const std::lock_guard lock(mutex);
  ModelPtr& original = compiled[name];
  if (original == nullptr) original = CompileModel(name, mjcf, files);
  ModelPtr copy(mj_copyModel(nullptr, original.get()));
  if (copy == nullptr) throw EngineError("cannot copy model '" + name + "'");
  return copy;
}

}  // namespace dreamsearch::mujoco
