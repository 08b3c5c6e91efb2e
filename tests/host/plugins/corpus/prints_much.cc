// Writes 100 MB to both outputs while it is loaded, then is a good plugin.
#include <unistd.h>

#include "tests/host/plugins/corpus/tiny_plugin.h"

WHILE_LOADING({
  static char block[1 << 20];
  for (char& c : block) c = 'x';
  for (int i = 0; i < 100; ++i) {
    for (const int descriptor : {1, 2}) {
      std::size_t written = 0;
      while (written < sizeof block) {
        const ssize_t n = ::write(descriptor, block + written, sizeof block - written);
        if (n <= 0) break;
        written += static_cast<std::size_t>(n);
      }
    }
  }
})
TINY_PLUGIN(prints_much)
