// Starts a process that outlives the loading and keeps its pipes.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING({
  const pid_t child = ::fork();
  if (child == 0) {
    ::sleep(1000);
    ::_exit(0);
  }
  if (const char* name = std::getenv("DREAMSEARCH_TEST_PID_FILE")) {
    if (std::FILE* file = std::fopen(name, "w")) {
      std::fprintf(file, "%d", static_cast<int>(child));
      std::fclose(file);
    }
  }
  std::_Exit(3);
})
TINY_PLUGIN(leaves_a_child)
