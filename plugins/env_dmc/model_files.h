// model_files.h - the MJCF files of models/, carried inside the plugin.
#pragma once

#include <string>
#include <vector>

namespace dreamsearch::dmc {

struct ModelFile {
  const char* name;  // without a folder: "walker.xml"
  const char* text;
};

// All files of models/, in the order of their names. Defined at build time.
const std::vector<ModelFile>& ModelFiles();

}  // namespace dreamsearch::dmc
