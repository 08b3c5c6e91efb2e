// strip.h - small pictures of an episode that `runner render --strip` keeps with a run.
#pragma once

#include <cstddef>

namespace dreamsearch::results {

// In the run's folder: so many pictures of that size, side by side.
inline constexpr char kStripFile[] = "strip.png";
inline constexpr std::size_t kStripPictures = 8;
inline constexpr int kStripWidth = 128;
inline constexpr int kStripHeight = 96;
// A file of another size is none of ours.
inline constexpr std::size_t kMostStripBytes = 400'000;

}  // namespace dreamsearch::results
