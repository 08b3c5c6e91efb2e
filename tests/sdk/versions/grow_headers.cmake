# cmake -DFROM=sdk/include -DTO=folder -P grow_headers.cmake
#
# Copies the SDK's headers as the next minor version might have them: every struct that crosses the
# boundary has one more field, `grown`, where version.h says that later fields go, and there is one
# more trait.
file(GLOB headers RELATIVE ${FROM} ${FROM}/dreamsearch/*.h)
set(sized 0)
set(records 0)
foreach(header IN LISTS headers)
  file(READ ${FROM}/${header} text)
  string(REGEX MATCHALL "std::uint64_t struct_size = sizeof\\([A-Za-z]+\\)" found "${text}")
  list(LENGTH found count)
  math(EXPR sized "${sized} + ${count}")
  string(REGEX MATCHALL "// Later fields go here" found "${text}")
  list(LENGTH found count)
  math(EXPR records "${records} + ${count}")
  string(REGEX REPLACE "#define DREAMSEARCH_SDK_MINOR [0-9]+" "#define DREAMSEARCH_SDK_MINOR 1000"
         text "${text}")
  string(REPLACE "// Later fields go here." "double grown = 7.5;" text "${text}")
  # A descriptor's size stands at its head.
  string(REPLACE "struct_size = sizeof(PluginDescriptor)" "struct_size = sizeof(PluginDescriptor )"
         text "${text}")
  string(REGEX REPLACE "(std::uint64_t struct_size = sizeof\\([A-Za-z]+\\);)"
         "\\1 double grown = 7.5;" text "${text}")
  string(REPLACE "kNeedsGradients = 1u << 8," "kNeedsGradients = 1u << 8, kLater = 1u << 30,"
         text "${text}")
  string(REPLACE "kReportsPolicy | kNeedsGradients;" "kReportsPolicy | kNeedsGradients | kLater;"
         text "${text}")
  file(WRITE ${TO}/${header} "${text}")
endforeach()
if(NOT sized EQUAL 18 OR NOT records EQUAL 8)
  message(FATAL_ERROR "expected 18 structs with their size and 8 that grow at the end, found "
                      "${sized} and ${records}: is the new one grown here too?")
endif()
