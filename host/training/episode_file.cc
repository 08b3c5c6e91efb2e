#include "host/training/episode_file.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "host/saving/npz.h"

namespace dreamsearch {

EpisodeFile WriteEpisodes(const Replay& replay, std::uint64_t first_episode,
                          const std::filesystem::path& path) {
  const std::uint64_t rows = replay.rows();
  std::vector<std::uint8_t> terminated(rows), truncated(rows);
  std::vector<std::int64_t> episode(rows);
  std::uint64_t index = first_episode;
  for (const Replay::Episode& one : replay.episodes()) {
    std::fill_n(episode.begin() + static_cast<std::ptrdiff_t>(one.first), one.rows,
                static_cast<std::int64_t>(index++));
    const std::uint64_t last = one.first + one.rows - 1;
    terminated[last] = replay.discounts()[last] == 0;
    truncated[last] = one.finished != 0 && terminated[last] == 0;
  }
  const auto array = [](const char* name, const char* type, std::vector<std::uint64_t> shape,
                        const auto* data, std::uint64_t count) {
    return NpzArray{name, type, std::move(shape), data, count * sizeof *data};
  };
  const MatrixView<const float> observations = replay.observations(), actions = replay.actions();
  EpisodeFile file;
  file.rows = rows;
  file.episodes = replay.episodes().size();
  file.bytes =
      WriteNpz(path, {array("observations", "<f4", {rows, observations.cols}, observations.data,
                            observations.size()),
                      array("actions", "<f4", {rows, actions.cols}, actions.data, actions.size()),
                      array("rewards", "<f4", {rows}, replay.rewards().data, rows),
                      array("terminated", "|b1", {rows}, terminated.data(), rows),
                      array("truncated", "|b1", {rows}, truncated.data(), rows),
                      array("episode", "<i8", {rows}, episode.data(), rows)});
  return file;
}

}  // namespace dreamsearch
