// model_folder.h - compiling the user's own model without letting it out of its folder.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "plugins/mujoco/engine.h"

namespace dreamsearch::mjcf {

struct FolderModel {
  mujoco::ModelPtr model;
  // The files beside the model file that the engine may have read: SHA-256 in hexadecimal, by the
  // path from the model's folder.
  std::map<std::string, std::string> files;
};

// Compiles a model file. It may include files and name meshes, textures, height fields and skins
// in the folder that it lies in and in the folders below; by a path that is absolute, that climbs
// out or that leaves through a symbolic link it is refused before the engine sees it.
//   EngineError  the model or a file that it names is missing, lies outside, or does not compile.
FolderModel CompileInFolder(const std::filesystem::path& path);

}  // namespace dreamsearch::mjcf
