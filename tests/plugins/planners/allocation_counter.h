// allocation_counter.h - how many times this process called operator new.
#pragma once

#include <cstdint>

namespace dreamsearch {

// Counts allocations of the test program and of every plugin it loads.
std::uint64_t AllocationCount();

}  // namespace dreamsearch
