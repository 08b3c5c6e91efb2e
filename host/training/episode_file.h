// episode_file.h - what a run has lived through, for other programs.
//
// An .npz file of these arrays. A row is one decision's outcome; the first row of an episode is its
// first observation, with an action and a reward of zero. R rows, oldest first.
//
//   observations  float32 [R, O]
//   actions       float32 [R, A]  in [-1, 1], the one that led to the row's observation
//   rewards       float32 [R]     of that decision: a sum over its action repeat
//   terminated    bool    [R]     the observation is a terminal state
//   truncated     bool    [R]     the episode ended there for another reason: time, budget,
//                                 divergence
//   episode       int64   [R]     counted from the run's first training episode
#pragma once

#include <cstdint>
#include <filesystem>

#include "host/training/replay.h"

namespace dreamsearch {

struct EpisodeFile {
  std::uint64_t rows = 0;
  std::uint64_t episodes = 0;
  std::uint64_t bytes = 0;
};

// Of a replay whose first episode is the run's `first_episode`.
EpisodeFile WriteEpisodes(const Replay& replay, std::uint64_t first_episode,
                          const std::filesystem::path& path);

}  // namespace dreamsearch
