#include "host/training/replay.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <string>

#include "results/system/error.h"

namespace dreamsearch {

Replay::Replay(std::uint64_t observation_size, std::uint64_t action_size, std::uint64_t capacity,
               std::uint64_t search_candidates)
    : observation_size_(observation_size),
      action_size_(action_size),
      capacity_(capacity),
      candidates_(search_candidates) {
  observations_ = std::make_unique_for_overwrite<float[]>(capacity * observation_size);
  actions_ = std::make_unique_for_overwrite<float[]>(capacity * action_size);
  rewards_ = std::make_unique_for_overwrite<float[]>(capacity);
  discounts_ = std::make_unique_for_overwrite<float[]>(capacity);
  is_first_ = std::make_unique_for_overwrite<std::uint8_t[]>(capacity);
  if (candidates_ == 0) return;
  search_actions_ = std::make_unique_for_overwrite<float[]>(capacity * candidates_ * action_size);
  search_weights_ = std::make_unique_for_overwrite<float[]>(capacity * candidates_);
  search_values_ = std::make_unique_for_overwrite<float[]>(capacity);
}

void Replay::BeginEpisode(View<const double> observation) {
  if (rows_ == capacity_) MakeRoom();
  episodes_.push_back({rows_, 0, 0});
  Append({}, 0, 1, observation, true);
}

void Replay::Add(View<const double> action, double reward, double discount,
                 View<const double> observation) {
  assert(!episodes_.empty() && !episodes_.back().finished);
  if (rows_ == capacity_) MakeRoom();
  Append(action, reward, discount, observation, false);
}

void Replay::Set(const RootSearch& search, std::uint64_t row, float* actions, float* weights,
                 float* values) const {
  assert(search.weights.size == candidates_ && search.actions.size() == candidates_ * action_size_);
  const auto narrow = [](double value) { return static_cast<float>(value); };
  std::transform(search.actions.data, search.actions.data + search.actions.size(),
                 actions + row * candidates_ * action_size_, narrow);
  std::transform(search.weights.begin(), search.weights.end(), weights + row * candidates_, narrow);
  values[row] = narrow(search.value);
}

void Replay::SetSearch(const RootSearch& search) {
  assert(!episodes_.empty() && !episodes_.back().finished);
  Set(search, rows_ - 1, search_actions_.get(), search_weights_.get(), search_values_.get());
}

void Replay::RenewSearch(std::uint64_t batch_row, const RootSearch& search) {
  const std::uint64_t row = RowOf(batch_row);
  Set(search, row, search_actions_.get(), search_weights_.get(), search_values_.get());
  Set(search, batch_row, batch_search_actions_.data(), batch_search_weights_.data(),
      batch_search_values_.data());
}

std::uint64_t Replay::DecisionOf(std::uint64_t batch_row) const {
  const std::uint64_t row = RowOf(batch_row);
  std::uint64_t first = row;
  while (is_first_[first] == 0) --first;
  return row - first;
}

void Replay::EndEpisode() {
  assert(!episodes_.empty() && !episodes_.back().finished);
  episodes_.back().finished = 1;
  finished_rows_ += episodes_.back().rows;
}

void Replay::Append(View<const double> action, double reward, double discount,
                    View<const double> observation, bool is_first) {
  assert(observation.size == observation_size_);
  float* to = observations_.get() + rows_ * observation_size_;
  for (std::uint64_t i = 0; i < observation_size_; ++i) to[i] = static_cast<float>(observation[i]);
  to = actions_.get() + rows_ * action_size_;
  for (std::uint64_t i = 0; i < action_size_; ++i) {
    to[i] = is_first ? 0.0f : static_cast<float>(action[i]);
  }
  rewards_[rows_] = static_cast<float>(reward);
  discounts_[rows_] = static_cast<float>(discount);
  is_first_[rows_] = is_first ? 1 : 0;
  if (candidates_ != 0) {  // until it is searched
    std::fill_n(search_actions_.get() + rows_ * candidates_ * action_size_,
                candidates_ * action_size_, 0.0f);
    std::fill_n(search_weights_.get() + rows_ * candidates_, candidates_, 0.0f);
    search_values_[rows_] = 0;
  }
  ++rows_;
  ++episodes_.back().rows;
}

// Forgets the oldest finished episodes, an eighth of the capacity at a time, so
// that moving the rest down costs little a row.
void Replay::MakeRoom() {
  std::uint64_t drop = 0;
  while (drop < episodes_.size() && episodes_[drop].finished &&
         (drop == 0 || episodes_[drop].first < capacity_ / 8)) {
    ++drop;
  }
  if (drop == 0) {
    throw Failure(ExitCode::kUsage,
                  "run.replay_capacity " + std::to_string(capacity_) +
                      " does not hold one episode; give at least the decisions of two episodes");
  }
  const std::uint64_t cut = drop < episodes_.size() ? episodes_[drop].first : rows_;
  for (std::uint64_t i = 0; i < drop; ++i) finished_rows_ -= episodes_[i].rows;
  episodes_.erase(episodes_.begin(), episodes_.begin() + static_cast<std::ptrdiff_t>(drop));
  for (Episode& episode : episodes_) episode.first -= cut;
  const auto move_down = [&](auto& values, std::uint64_t width) {
    std::copy(values.get() + cut * width, values.get() + rows_ * width, values.get());
  };
  move_down(observations_, observation_size_);
  move_down(actions_, action_size_);
  move_down(rewards_, 1);
  move_down(discounts_, 1);
  move_down(is_first_, 1);
  if (candidates_ != 0) {
    move_down(search_actions_, candidates_ * action_size_);
    move_down(search_weights_, candidates_);
    move_down(search_values_, 1);
  }
  rows_ -= cut;
}

std::uint64_t Replay::DrawStart(std::uint64_t length, std::uint64_t longest, std::size_t finished,
                                Random* random) const {
  const Episode* episode = nullptr;
  do {  // no draw decides where all episodes are equally long
    episode = &episodes_[random->Below(finished)];
  } while (episode->rows < longest && random->Below(longest) >= episode->rows);
  const bool ends = discounts_[episode->first + episode->rows - 1] == 0;
  const std::uint64_t starts =
      ends || episode->rows < length ? episode->rows : episode->rows - length + 1;
  return std::min(episode->first + random->Below(starts), finished_rows_ - length);
}

SequenceBatch Replay::Sample(std::uint64_t sequences, std::uint64_t length, std::uint64_t seed) {
  if (finished_rows_ < length) {
    throw Failure(ExitCode::kUsage,
                  "run.sequence_length: expected at most the " + std::to_string(finished_rows_) +
                      " observations of the episodes so far, found " + std::to_string(length) +
                      "; give a larger run.prefill_steps");
  }
  std::uint64_t longest = 0;
  std::size_t finished = 0;
  for (const Episode& episode : episodes_) {
    if (!episode.finished) break;  // the last one
    longest = std::max(longest, episode.rows);
    ++finished;
  }
  const std::uint64_t rows = sequences * length;
  batch_observations_.resize(rows * observation_size_);
  batch_actions_.resize(rows * action_size_);
  batch_rewards_.resize(rows);
  batch_discounts_.resize(rows);
  batch_is_first_.resize(rows);
  batch_starts_.resize(sequences);
  batch_length_ = length;
  if (candidates_ != 0) {
    batch_search_actions_.resize(rows * candidates_ * action_size_);
    batch_search_weights_.resize(rows * candidates_);
    batch_search_values_.resize(rows);
  }

  Random random(seed);
  for (std::uint64_t b = 0; b < sequences; ++b) {
    const std::uint64_t start = DrawStart(length, longest, finished, &random);
    batch_starts_[b] = start;
    const auto copy = [&](const auto& from, auto& to, std::uint64_t width) {
      std::copy_n(from.get() + start * width, length * width,
                  to.begin() + static_cast<std::ptrdiff_t>(b * length * width));
    };
    copy(observations_, batch_observations_, observation_size_);
    copy(actions_, batch_actions_, action_size_);
    copy(rewards_, batch_rewards_, 1);
    copy(discounts_, batch_discounts_, 1);
    copy(is_first_, batch_is_first_, 1);
    if (candidates_ == 0) continue;
    copy(search_actions_, batch_search_actions_, candidates_ * action_size_);
    copy(search_weights_, batch_search_weights_, candidates_);
    copy(search_values_, batch_search_values_, 1);
  }
  SequenceBatch batch;
  batch.sequences = sequences;
  batch.length = length;
  batch.observations = {batch_observations_.data(), rows, observation_size_};
  batch.actions = {batch_actions_.data(), rows, action_size_};
  batch.rewards = {batch_rewards_.data(), rows};
  batch.discounts = {batch_discounts_.data(), rows};
  batch.is_first = {batch_is_first_.data(), rows};
  if (candidates_ != 0) {
    batch.search_candidates = candidates_;
    batch.search_actions = {batch_search_actions_.data(), rows * candidates_, action_size_};
    batch.search_weights = {batch_search_weights_.data(), rows * candidates_};
    batch.search_values = {batch_search_values_.data(), rows};
  }
  return batch;
}

void Replay::Save(StateWriter* writer) const {
  (*writer)("observation_size", &observation_size_);
  (*writer)("action_size", &action_size_);
  (*writer)("rows", &rows_);
  std::vector<std::uint64_t> first, rows, finished;
  for (const Episode& episode : episodes_) {
    first.push_back(episode.first);
    rows.push_back(episode.rows);
    finished.push_back(episode.finished);
  }
  (*writer)("episode_first", &first);
  (*writer)("episode_rows", &rows);
  (*writer)("episode_finished", &finished);
  writer->Array("observations", observations_.get(), rows_ * observation_size_);
  writer->Array("actions", actions_.get(), rows_ * action_size_);
  writer->Array("rewards", rewards_.get(), rows_);
  writer->Array("discounts", discounts_.get(), rows_);
  writer->Array("is_first", is_first_.get(), rows_);
  if (candidates_ == 0) return;
  writer->Array("search_actions", search_actions_.get(), rows_ * candidates_ * action_size_);
  writer->Array("search_weights", search_weights_.get(), rows_ * candidates_);
  writer->Array("search_values", search_values_.get(), rows_);
}

Replay::Sizes::Sizes(StateReader* reader) {
  (*reader)("observation_size", &observation);
  (*reader)("action_size", &action);
  (*reader)("rows", &rows);
}

std::unique_ptr<Replay> Replay::Read(std::uint64_t search_candidates, StateReader* reader) {
  const Sizes sizes(reader);
  // A row takes this many bytes at least, so a file that is shorter holds no such replay.
  const std::uint64_t most = reader->left() / sizeof(float);
  if (sizes.observation == 0 || sizes.action == 0 || sizes.rows == 0 || sizes.observation > most ||
      sizes.action > most || sizes.rows > most / (sizes.observation + sizes.action)) {
    reader->Refuse("the replay has " + std::to_string(sizes.rows) + " rows with observations of " +
                   std::to_string(sizes.observation) + " and actions of " +
                   std::to_string(sizes.action) + ", more than the bytes that follow hold");
  }
  auto replay =
      std::make_unique<Replay>(sizes.observation, sizes.action, sizes.rows, search_candidates);
  replay->LoadRows(sizes.rows, reader);
  return replay;
}

void Replay::Load(StateReader* reader) {
  const Sizes sizes(reader);
  if (sizes.observation != observation_size_ || sizes.action != action_size_ ||
      sizes.rows > capacity_) {
    reader->Refuse("the replay does not fit: observations of " + std::to_string(sizes.observation) +
                   ", actions of " + std::to_string(sizes.action) + ", " +
                   std::to_string(sizes.rows) + " rows; expected " +
                   std::to_string(observation_size_) + ", " + std::to_string(action_size_) +
                   ", at most " + std::to_string(capacity_));
  }
  LoadRows(sizes.rows, reader);
}

void Replay::LoadRows(std::uint64_t rows, StateReader* reader) {
  std::vector<std::uint64_t> first, lengths, finished;
  (*reader)("episode_first", &first);
  (*reader)("episode_rows", &lengths);
  (*reader)("episode_finished", &finished);
  std::vector<Episode> episodes(first.size());
  std::uint64_t finished_rows = 0, next = 0;
  bool fits = lengths.size() == first.size() && finished.size() == first.size();
  for (std::size_t i = 0; fits && i < first.size(); ++i) {
    fits = first[i] == next && lengths[i] >= 1 && lengths[i] <= rows - next &&
           (finished[i] == 1 || (finished[i] == 0 && i + 1 == first.size()));
    next += lengths[i];
    episodes[i] = {first[i], lengths[i], finished[i]};
    if (finished[i] != 0) finished_rows += lengths[i];
  }
  if (!fits || next != rows) {
    reader->Refuse("the replay's episodes are not its " + std::to_string(rows) + " rows");
  }
  reader->Array("observations", observations_.get(), rows * observation_size_);
  reader->Array("actions", actions_.get(), rows * action_size_);
  reader->Array("rewards", rewards_.get(), rows);
  reader->Array("discounts", discounts_.get(), rows);
  reader->Array("is_first", is_first_.get(), rows);
  if (candidates_ != 0) {
    reader->Array("search_actions", search_actions_.get(), rows * candidates_ * action_size_);
    reader->Array("search_weights", search_weights_.get(), rows * candidates_);
    reader->Array("search_values", search_values_.get(), rows);
  }
  std::size_t begins = 0;
  for (std::uint64_t row = 0; row < rows; ++row) {
    const bool first_row = begins < episodes.size() && episodes[begins].first == row;
    if (is_first_[row] != (first_row ? 1 : 0)) {
      reader->Refuse("field 'is_first': row " + std::to_string(row) +
                     " is said to begin an episode otherwise than its episodes do");
    }
    if (first_row) ++begins;
  }
  rows_ = rows;
  episodes_ = std::move(episodes);
  finished_rows_ = finished_rows;
}

}  // namespace dreamsearch
