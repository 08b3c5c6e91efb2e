# dreamsearch_add_plugin(NAME SOURCES file... [LINK target...] [OUTPUT_DIR dir])
#
# Builds NAME.so as a plugin: C++20, hidden symbols, no undefined symbols, no "lib" prefix, no
# soname. Products and sums are not fused (-ffp-contract=off), so that scalar code has the same
# bits whichever instruction set it is compiled for. The numeric or physics libraries it needs
# go to LINK. NAME.so is built in OUTPUT_DIR, by default in DREAMSEARCH_PLUGIN_OUTPUT_DIR if that
# is set, otherwise in the current binary folder.
function(dreamsearch_add_plugin name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "OUTPUT_DIR" "SOURCES;LINK")
  if(NOT arg_SOURCES OR arg_UNPARSED_ARGUMENTS OR arg_KEYWORDS_MISSING_VALUES)
    message(FATAL_ERROR "dreamsearch_add_plugin(${name}): expected "
                        "NAME SOURCES file... [LINK target...] [OUTPUT_DIR dir], found: ${ARGV}")
  endif()
  add_library(${name} MODULE ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE dreamsearch::sdk ${arg_LINK})
  target_compile_options(${name} PRIVATE -ffp-contract=off)
  if(NOT arg_OUTPUT_DIR)
    set(arg_OUTPUT_DIR ${DREAMSEARCH_PLUGIN_OUTPUT_DIR})
  endif()
  if(NOT arg_OUTPUT_DIR)
    set(arg_OUTPUT_DIR ${CMAKE_CURRENT_BINARY_DIR})
  endif()
  set_target_properties(${name} PROPERTIES
    PREFIX "" SUFFIX ".so" NO_SONAME ON
    CXX_STANDARD 20 CXX_STANDARD_REQUIRED ON CXX_EXTENSIONS OFF
    CXX_VISIBILITY_PRESET hidden
    VISIBILITY_INLINES_HIDDEN ON
    POSITION_INDEPENDENT_CODE ON
    LIBRARY_OUTPUT_DIRECTORY ${arg_OUTPUT_DIR})
  # A sanitizer's functions are in the program that loads the plugin.
  if(NOT DREAMSEARCH_SANITIZE AND NOT CMAKE_CXX_FLAGS MATCHES "-fsanitize")
    target_link_options(${name} PRIVATE -Wl,-z,defs)
  endif()
endfunction()
