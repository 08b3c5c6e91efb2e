// model_files.h - the MJCF files of models/, carried inside the plugin.
#pragma once

#include <span>
#include <string>

#include "plugins/mujoco/engine.h"

namespace dreamsearch::dmc {

// All files of models/, in the order of their names.
std::span<const mujoco::ModelFile> ModelFiles();

// The text of a file of models/.
//   EngineError  there is none of that name.
std::string ModelText(const std::string& file);

// A copy of the model that `mjcf` describes, which may include the files of models/.
mujoco::ModelPtr CopyOfCompiled(const std::string& name, const std::string& mjcf);

}  // namespace dreamsearch::dmc
