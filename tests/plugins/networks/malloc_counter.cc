#include "tests/plugins/networks/malloc_counter.h"

#include <atomic>
#include <cstddef>

namespace dreamsearch {
namespace {

std::atomic<std::uint64_t> allocations{0};

}  // namespace

std::uint64_t MallocCount() { return allocations.load(); }

}  // namespace dreamsearch

#if DREAMSEARCH_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
__attribute__((visibility("default"))) void* malloc(std::size_t size) {
  dreamsearch::allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
__attribute__((visibility("default"))) void* aligned_alloc(std::size_t alignment,
                                                           std::size_t size) {
  dreamsearch::allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_memalign(alignment, size);
}
}
#endif
