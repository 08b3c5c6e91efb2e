# cmake -D OUTPUT=file.cc -D MODELS=a.xml,b.xml -P embed.cmake
#
# Writes a C++ file that holds the text of every model file, so that the plugin
# needs no file beside it.
string(REPLACE "," ";" models "${MODELS}")
set(text "// Made by embed.cmake from models/*.xml.\n#include \"model_files.h\"\n\n")
string(APPEND text "namespace dreamsearch::dmc {\n\nconst std::vector<ModelFile>& ModelFiles() {\n")
string(APPEND text "  static const std::vector<ModelFile> files = {\n")
foreach(model IN LISTS models)
  get_filename_component(name ${model} NAME)
  file(READ ${model} xml)
  string(APPEND text "      {\"${name}\", R\"mjcf(${xml})mjcf\"},\n")
endforeach()
string(APPEND text "  };\n  return files;\n}\n\n}  // namespace dreamsearch::dmc\n")
file(WRITE ${OUTPUT} "${text}")
