// allocation_counter.cc - counts every allocation of the process it is loaded into.
//
// A shared library: `runner check` preloads it, a test program links it (dreamsearch::allocations)
// and so has its functions before those of the C library. Nothing else of dreamsearch uses it.
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace {
std::atomic<std::uint64_t> allocations{0};
void Count() { allocations.fetch_add(1, std::memory_order_relaxed); }
}  // namespace

#define DREAMSEARCH_EXPORT __attribute__((visibility("default")))

extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

DREAMSEARCH_EXPORT std::uint64_t dreamsearch_allocations() { return allocations; }

DREAMSEARCH_EXPORT void* malloc(std::size_t size) {
  Count();
  return __libc_malloc(size);
}
DREAMSEARCH_EXPORT void* calloc(std::size_t count, std::size_t size) {
  Count();
  return __libc_calloc(count, size);
}
DREAMSEARCH_EXPORT void* realloc(void* memory, std::size_t size) {
  Count();
  return __libc_realloc(memory, size);
}
DREAMSEARCH_EXPORT void* memalign(std::size_t alignment, std::size_t size) {
  Count();
  return __libc_memalign(alignment, size);
}
DREAMSEARCH_EXPORT void* aligned_alloc(std::size_t alignment, std::size_t size) {
  Count();
  return __libc_memalign(alignment, size);
}
DREAMSEARCH_EXPORT int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  constexpr int kNoMemory = 12;
  Count();
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? kNoMemory : 0;
}

}  // extern "C"
