// batches.h - sequences for the tests to learn from.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/random.h"

namespace dreamsearch {

// B sequences of T steps with memory of their own.
struct OwnedBatch {
  OwnedBatch(std::uint64_t sequences_in, std::uint64_t length_in, std::uint64_t o, std::uint64_t a)
      : sequences(sequences_in),
        length(length_in),
        observation_size(o),
        action_size(a),
        observations(sequences * length * o),
        actions(sequences * length * a),
        rewards(sequences * length),
        discounts(sequences * length, 1.0f),
        is_first(sequences * length, 0) {}

  SequenceBatch view() const {
    const std::uint64_t rows = sequences * length;
    return {sequences,
            length,
            {observations.data(), rows, observation_size},
            {actions.data(), rows, action_size},
            {rewards.data(), rows},
            {discounts.data(), rows},
            {is_first.data(), rows},
            search_candidates,
            {search_actions.data(), rows * search_candidates, action_size},
            {search_weights.data(), rows * search_candidates},
            {search_values.data(), search_values.size()}};
  }

  // A search of every row but each third, with `candidates` actions of equal weight.
  void AddSearches(std::uint64_t candidates, std::uint64_t seed) {
    const std::uint64_t rows = sequences * length;
    search_candidates = candidates;
    search_actions.resize(rows * candidates * action_size);
    search_weights.assign(rows * candidates, 0);
    search_values.resize(rows);
    Random random(seed);
    for (float& x : search_actions) x = static_cast<float>(random.Uniform(-1, 1));
    for (float& x : search_values) x = static_cast<float>(random.Uniform(-3, 3));
    for (std::uint64_t i = 0; i < rows * candidates; ++i) {
      if (i / candidates % 3 != 0) search_weights[i] = 1.0f / static_cast<float>(candidates);
    }
  }

  std::uint64_t sequences, length, observation_size, action_size;
  std::vector<float> observations, actions, rewards, discounts;
  std::vector<std::uint8_t> is_first;
  std::uint64_t search_candidates = 0;
  std::vector<float> search_actions, search_weights, search_values;
};

// Independent draws, with a few terminal states.
inline OwnedBatch RandomBatch(std::uint64_t sequences, std::uint64_t length, std::uint64_t o,
                              std::uint64_t a, std::uint64_t seed) {
  OwnedBatch batch(sequences, length, o, a);
  Random random(seed);
  for (float& x : batch.observations) x = static_cast<float>(random.Normal());
  for (float& x : batch.actions) x = static_cast<float>(random.Uniform(-1, 1));
  for (float& x : batch.rewards) x = static_cast<float>(random.Uniform(0, 2));
  for (float& x : batch.discounts) x = random.Below(8) == 0 ? 0.0f : 1.0f;
  for (std::uint64_t b = 0; b < sequences; b += 2) batch.is_first[b * length] = 1;
  return batch;
}

// A point on a line pushed by its action: x' = 0.9 x + 0.3 a, observed as (x, x^2);
// the reward is 1 - x'^2, best at the origin. Actions are uniform.
inline OwnedBatch PointBatch(std::uint64_t sequences, std::uint64_t length, std::uint64_t seed) {
  OwnedBatch batch(sequences, length, 2, 1);
  Random random(seed);
  for (std::uint64_t b = 0; b < sequences; ++b) {
    double x = random.Uniform(-1, 1);
    for (std::uint64_t t = 0; t < length; ++t) {
      const std::uint64_t row = b * length + t;
      const double action = t == 0 ? 0 : random.Uniform(-1, 1);
      if (t > 0) x = 0.9 * x + 0.3 * action;
      batch.observations[2 * row] = static_cast<float>(x);
      batch.observations[2 * row + 1] = static_cast<float>(x * x);
      batch.actions[row] = static_cast<float>(action);
      batch.rewards[row] = t == 0 ? 0.0f : static_cast<float>(1 - x * x);
    }
    batch.is_first[b * length] = 1;
  }
  return batch;
}

}  // namespace dreamsearch
