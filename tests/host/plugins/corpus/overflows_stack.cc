// Recurses without end while it is loaded.
#include "tests/host/plugins/corpus/tiny_plugin.h"

namespace {
int Recurse(volatile int* above) {
  volatile int here[256] = {*above};
  return here[0] == 0 ? 0 : Recurse(here) + here[1];  // it is 1
}
int Begin() {
  volatile int start = 1;
  return Recurse(&start);
}
}  // namespace
WHILE_LOADING(Begin())
TINY_PLUGIN(overflows_stack)
