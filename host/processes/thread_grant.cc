#include "host/processes/thread_grant.h"

#include <sys/mman.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <string>

#include "results/system/error.h"
#include "results/system/file_descriptor.h"

namespace dreamsearch {

ThreadGrant::ThreadGrant() : descriptor_(MemoryFile(std::string(sizeof *threads_, '\0'))) {
  Map(descriptor_.get());
  new (threads_) std::atomic<std::uint32_t>(1);
}

ThreadGrant::ThreadGrant(int descriptor) {
  const FileDescriptor handed_down(descriptor);
  Map(descriptor);
}

ThreadGrant::~ThreadGrant() { ::munmap(threads_, sizeof *threads_); }

void ThreadGrant::Map(int descriptor) {
  void* memory =
      ::mmap(nullptr, sizeof *threads_, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  if (memory == MAP_FAILED) {
    throw Failure(ExitCode::kInternal,
                  std::string("cannot map the number of threads: ") + std::strerror(errno));
  }
  threads_ = static_cast<std::atomic<std::uint32_t>*>(memory);
}

}  // namespace dreamsearch
