// Takes all the memory there is while it is loaded.
#include <cstring>
#include <new>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING(for (;;) {
  constexpr std::size_t kBlock = 64 << 20;
  std::memset(::operator new(kBlock), 1, kBlock);
})
TINY_PLUGIN(allocates_without_end)
