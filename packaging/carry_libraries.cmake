# Copies the libraries that `programs` and `plugins` need into lib/dreamsearch/libraries below the
# prefix, each under the name by which it is looked for, and the licence of each. Not those that
# belong to the system: glibc, libstdc++ and libgcc must be no older than what else is loaded
# there. What is opened at run time only, EGL, is the system's too.
file(GET_RUNTIME_DEPENDENCIES
  EXECUTABLES ${programs} MODULES ${plugins}
  RESOLVED_DEPENDENCIES_VAR libraries
  UNRESOLVED_DEPENDENCIES_VAR missing
  PRE_EXCLUDE_REGEXES
    "^lib(c|m|dl|rt|pthread|resolv|util)\\.so" "^ld-linux" "^lib(stdc\\+\\+|gcc_s)\\.so")
if(missing)
  message(FATAL_ERROR "libraries are not found: ${missing}")
endif()

set(prefix $ENV{DESTDIR}${CMAKE_INSTALL_PREFIX})
file(MAKE_DIRECTORY ${prefix}/lib/dreamsearch/libraries ${prefix}/share/doc/dreamsearch/licences)
find_program(DPKG_QUERY dpkg-query)
foreach(library IN LISTS libraries)
  get_filename_component(name ${library} NAME)
  file(REAL_PATH ${library} file)
  message(STATUS "Carrying: ${name}")
  file(COPY_FILE ${file} ${prefix}/lib/dreamsearch/libraries/${name} ONLY_IF_DIFFERENT)

  # Where the library comes from no package, its licence is for who builds the package to add.
  if(DPKG_QUERY)
    # Installed as /lib, a link to /usr/lib, or as /usr/lib.
    string(REGEX REPLACE "^/usr" "" short ${file})
    execute_process(COMMAND ${DPKG_QUERY} -S ${file} ${short}
      OUTPUT_VARIABLE owners ERROR_QUIET)
    string(REGEX MATCH "^[^:,\n]+" package "${owners}")
  endif()
  if(package AND EXISTS /usr/share/doc/${package}/copyright)
    file(REAL_PATH /usr/share/doc/${package}/copyright licence)
    file(COPY_FILE ${licence} ${prefix}/share/doc/dreamsearch/licences/${package}
         ONLY_IF_DIFFERENT)
  else()
    message(WARNING "no licence of ${file} is known")
  endif()
endforeach()
