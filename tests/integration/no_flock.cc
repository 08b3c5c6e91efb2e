// A library to preload: a file system without flock.
#include <cerrno>

extern "C" __attribute__((visibility("default"))) int flock(int, int) {
  errno = NO_FLOCK_ERROR;
  return -1;
}
