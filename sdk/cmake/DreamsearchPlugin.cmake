# dreamsearch_add_plugin(NAME SOURCES file... [LINK target...] [OUTPUT_DIR dir])
#
# Builds NAME.so as a plugin: hidden symbols, no undefined symbols, no "lib"
# prefix. The numeric or physics libraries it needs go to LINK.
function(dreamsearch_add_plugin name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "OUTPUT_DIR" "SOURCES;LINK")
  add_library(${name} MODULE ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE dreamsearch::sdk ${arg_LINK})
  if(NOT arg_OUTPUT_DIR)
    set(arg_OUTPUT_DIR ${DREAMSEARCH_PLUGIN_OUTPUT_DIR})
  endif()
  set_target_properties(${name} PROPERTIES
    PREFIX "" SUFFIX ".so"
    CXX_VISIBILITY_PRESET hidden
    VISIBILITY_INLINES_HIDDEN ON
    POSITION_INDEPENDENT_CODE ON
    LIBRARY_OUTPUT_DIRECTORY ${arg_OUTPUT_DIR})
  if(NOT DREAMSEARCH_SANITIZE)
    target_link_options(${name} PRIVATE -Wl,-z,defs)
  endif()
endfunction()
