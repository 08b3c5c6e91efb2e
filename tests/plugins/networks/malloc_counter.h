// malloc_counter.h - what the program allocates, Eigen's memory and aligned memory included.
#pragma once

#include <cstdint>

// The sanitizers bring an allocator of their own, which is left alone.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define DREAMSEARCH_COUNTS_ALLOCATIONS 1
#else
#define DREAMSEARCH_COUNTS_ALLOCATIONS 0
#endif

namespace dreamsearch {

std::uint64_t MallocCount();

}  // namespace dreamsearch
