// engine.h - MuJoCo made safe to call from a plugin.
//
// The engine reports trouble in three ways: an error, which by default waits for
// a key and ends the process; a warning, which by default writes a log file into
// the current folder; and a silent reset of a state that went bad. Here an error
// is an exception, a warning is a counter, and a silent reset shows up as such a
// counter, so that nothing passes unseen and nothing is written.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace dreamsearch::mujoco {

// The engine called mju_error, or refused a model.
struct EngineError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct ModelDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, ModelDeleter>;
using DataPtr = std::unique_ptr<mjData, DataDeleter>;

// Makes engine errors throw EngineError and engine warnings silent. Idempotent;
// must have been called before any other use of the engine.
void InstallEngineHandlers();

// A file that a model may refer to, held in memory.
struct ModelFile {
  std::string_view name;  // without a folder: "walker.xml"
  std::string_view bytes;
};

// Compiles MJCF text under the name it should have in messages. It may refer to
// `files` by their bare name and to nothing else: a path, absolute or relative, a
// texture folder or a mesh folder is refused before the engine sees it, so no model
// reaches a file of the machine.
//   EngineError  the text refers to a file it may not use, or does not compile.
ModelPtr CompileModel(const std::string& name, std::string_view mjcf,
                      std::span<const ModelFile> files);

// An attribute of MJCF that names a file or a folder: file, fileup, filename, meshdir, ...
struct FileReference {
  std::string attribute;
  std::string value;  // as written, entities and all; empty also where it is not quoted
  bool folder = false;
};

// All of them in the text, comments included: what an XML parser might skip is found rather
// than missed.
std::vector<FileReference> FileReferences(std::string_view mjcf);

// Compiles a file of the machine, whatever it refers to.
//   EngineError  it does not compile; the message has the path and the engine's reason.
ModelPtr CompileFile(const std::string& path);

// A copy of a model of one's own (tasks write to it). The first call for a name
// compiles `mjcf`, later ones copy. Safe to call from several threads.
ModelPtr CopyOfCompiled(const std::string& name, std::string_view mjcf,
                        std::span<const ModelFile> files);

}  // namespace dreamsearch::mujoco
