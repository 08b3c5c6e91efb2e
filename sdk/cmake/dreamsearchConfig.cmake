# find_package(dreamsearch) gives
#   dreamsearch::sdk           the headers, "dreamsearch/planner.h" and the others
#   dreamsearch::runner        the program, for tests of a plugin
#   dreamsearch_add_plugin()   see DreamsearchPlugin.cmake
include(${CMAKE_CURRENT_LIST_DIR}/dreamsearchTargets.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/DreamsearchPlugin.cmake)
