#include "engine.h"

#include <cctype>
#include <cstring>
#include <map>
#include <mutex>

#include "model_files.h"

namespace dreamsearch::dmc {
namespace {

void ThrowEngineError(const char* message) { throw EngineError(message); }
void IgnoreEngineWarning(const char*) {}  // mjData.warning counts it

bool IsModelFile(const std::string& name) {
  for (const ModelFile& file : ModelFiles()) {
    if (name == file.name) return true;
  }
  return false;
}

bool IsNameCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == ':';
}

// Looks at every `name="value"` of the text, comments included: what an XML
// parser might skip is then refused rather than missed.
void CheckFileReferences(const std::string& name, const std::string& mjcf) {
  for (std::size_t i = mjcf.find('='); i != std::string::npos; i = mjcf.find('=', i + 1)) {
    std::size_t end = i;
    while (end > 0 && std::isspace(static_cast<unsigned char>(mjcf[end - 1]))) --end;
    std::size_t begin = end;
    while (begin > 0 && IsNameCharacter(mjcf[begin - 1])) --begin;
    const std::string attribute = mjcf.substr(begin, end - begin);
    const bool is_file = attribute.starts_with("file");  // file, fileup, ..., filename
    const bool is_folder = attribute.size() > 3 && attribute.ends_with("dir");  // meshdir, ...
    if (!is_file && !is_folder) continue;
    std::size_t open = i + 1;
    while (open < mjcf.size() && std::isspace(static_cast<unsigned char>(mjcf[open]))) ++open;
    std::string value;
    if (open < mjcf.size() && (mjcf[open] == '"' || mjcf[open] == '\'')) {
      value = mjcf.substr(open + 1, mjcf.find(mjcf[open], open + 1) - open - 1);
    }
    if (is_folder || !IsModelFile(value)) {
      throw EngineError("model '" + name + "' refers to " + attribute + "=\"" + value +
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

void AddFile(mjVFS* vfs, const std::string& file, const std::string& text) {
  if (text.empty()) throw EngineError("'" + file + "' is empty");
  if (mj_makeEmptyFileVFS(vfs, file.c_str(), static_cast<int>(text.size())) != 0) {
    throw EngineError("cannot hold '" + file + "' in memory");
  }
  std::memcpy(vfs->filedata[mj_findFileVFS(vfs, file.c_str())], text.data(), text.size());
}

// All files of models/, for the engine to find by name.
VfsPtr FilesInMemory() {
  VfsPtr vfs(new mjVFS);
  mj_defaultVFS(vfs.get());
  for (const ModelFile& file : ModelFiles()) AddFile(vfs.get(), file.name, file.text);
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

std::string ModelText(const std::string& file) {
  for (const ModelFile& known : ModelFiles()) {
    if (file == known.name) return known.text;
  }
  throw EngineError("no model file '" + file + "'");
}

ModelPtr CompileModel(const std::string& name, const std::string& mjcf) {
  InstallEngineHandlers();
  CheckFileReferences(name, mjcf);

  char error[1000] = "";
  try {
    const VfsPtr files = FilesInMemory();
    const std::string root = "model:" + name;  // no file of models/ has a colon
    AddFile(files.get(), root, mjcf);
    ModelPtr model(mj_loadXML(root.c_str(), files.get(), error, sizeof error));
    if (model != nullptr) return model;
  } catch (const EngineError& raised) {
    throw EngineError("model '" + name + "' does not compile: " + raised.what());
  }
  throw EngineError("model '" + name + "' does not compile: " + error);
}

ModelPtr CopyOfCompiled(const std::string& name, const std::string& mjcf) {
  static std::mutex mutex;
  static std::map<std::string, ModelPtr> compiled;
  const std::lock_guard lock(mutex);
  ModelPtr& original = compiled[name];
  if (original == nullptr) original = CompileModel(name, mjcf);
  ModelPtr copy(mj_copyModel(nullptr, original.get()));
  if (copy == nullptr) throw EngineError("cannot copy model '" + name + "'");
  return copy;
}

}  // namespace dreamsearch::dmc
