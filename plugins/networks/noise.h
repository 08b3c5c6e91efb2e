// noise.h - standard normal draws, many at once.
//
// Draws 2k and 2k + 1 are the two of Box and Muller (1958) made from the
// k-th number of Random(seed): a function of (seed, index) alone,
// so the draws of an update can be held fixed while its gradient is checked.
#pragma once

#include <cstdint>

#include "plugins/networks/matrix.h"

namespace dreamsearch::networks {

// Fills draws[0 ... count - 1]. The largest size is sqrt(2 ln 2^24) = 5.8.
void FillNormal(std::uint64_t seed, float* draws, Index count);
void FillNormal(std::uint64_t seed, double* draws, Index count);

}  // namespace dreamsearch::networks
