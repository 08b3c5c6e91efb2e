# What `cpack` makes: -G DEB, which depends on Debian's libraries, and -G TGZ, which carries them.
set(CPACK_PACKAGE_NAME dreamsearch)
set(CPACK_PACKAGE_VENDOR dreamsearch)
set(DREAMSEARCH_MAINTAINER "The dreamsearch authors <dreamsearch@localhost>" CACHE STRING
    "Who answers for a Debian package, as Name <address>")
set(CPACK_PACKAGE_CONTACT ${DREAMSEARCH_MAINTAINER})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "agents that learn a model of their world and plan in it")
set(CPACK_PACKAGE_DESCRIPTION
"The program runner trains, evaluates and inspects agents for continuous
control: learned latent models (Dreamer, TD-MPC2) and planners that search in
them. It loads environments, models and planners from shared libraries, runs
seeded experiments and records every decision in an SQLite database. The
program results reads, compares and draws them. Headers and a CMake package
are there for plugins.")
set(CPACK_STRIP_FILES ON)
set(CPACK_THREADS 0)
set(CPACK_VERBATIM_VARIABLES ON)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# Pictures of curves, films, and the drawing of MuJoCo's scenes without a display.
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "gnuplot-nox, ffmpeg, libegl1, libgl1-mesa-dri")
# Environments of Python, plugins, and submission to a cluster.
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "python3, cmake, g++, slurm-client")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

# Read for each generator by itself.
string(CONFIGURE [[
if(CPACK_GENERATOR STREQUAL "DEB")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
else()
  set(CPACK_PACKAGE_FILE_NAME dreamsearch-@PROJECT_VERSION@-linux-@CMAKE_SYSTEM_PROCESSOR@)
  set(CPACK_INSTALL_CMAKE_PROJECTS
      "@PROJECT_BINARY_DIR@;dreamsearch;ALL;/;@PROJECT_BINARY_DIR@;dreamsearch;carried;/")
endif()
]] each_generator @ONLY)
file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/each_generator.cmake
     CONTENT "${each_generator}" @ONLY)
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_BINARY_DIR}/each_generator.cmake)
set(CPACK_GENERATOR "DEB;TGZ")
include(CPack)
