// replay.h - what the agent has lived through, and sequences drawn from it.
//
// Rows are stored in the order they were lived, as float32: row 0 of an episode
// is its first observation (zero action and reward), row i what the i-th decision
// led to. Only finished episodes are drawn from. With room for searches a row also keeps what
// the search from its observation found.
//
// Memory   address space for all rows is taken at construction, memory only by rows that were
//          lived.
// Errors   Failure; but for Load nothing is changed by a call that throws.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/random.h"
#include "dreamsearch/view.h"
#include "host/saving/state.h"

namespace dreamsearch {

// What a search found at its root: the policy and the value of PlanResult.
struct RootSearch {
  MatrixView<const double> actions;  // [K, A]
  View<const double> weights;        // [K]
  double value = 0;
};

class Replay {
 public:
  // Holds at most `capacity` rows; the oldest finished episodes make room. Searches are kept
  // with `search_candidates` actions; 0: not at all.
  Replay(std::uint64_t observation_size, std::uint64_t action_size, std::uint64_t capacity,
         std::uint64_t search_candidates = 0);

  // Starts an episode with its first observation, [O].
  void BeginEpisode(View<const double> observation);
  // Adds what one decision led to.
  void Add(View<const double> action, double reward, double discount,
           View<const double> observation);
  // Keeps the search made from the newest observation.
  void SetSearch(const RootSearch& search);
  // The episode may be drawn from now on.
  void EndEpisode();

  // Rows of finished episodes, and rows altogether.
  std::uint64_t finished_rows() const { return finished_rows_; }
  std::uint64_t rows() const { return rows_; }

  // Draws `sequences` sequences of `length` rows: an episode in proportion to its rows, then a
  // start in it uniformly. A sequence lies inside its episode, unless this is shorter or ended
  // in a terminal state: then it may begin anywhere and runs on into the episodes that follow,
  // so that no row is never drawn. Needs `length` finished rows. The result borrows the
  // replay's memory until the next call.
  SequenceBatch Sample(std::uint64_t sequences, std::uint64_t length, std::uint64_t seed);

  // Keeps a search made anew from the observation of a row of the last Sample, there and in the
  // batch.
  void RenewSearch(std::uint64_t batch_row, const RootSearch& search);
  // Which decision of its episode that observation led to; 0 is the first.
  std::uint64_t DecisionOf(std::uint64_t batch_row) const;

  // Straight from and to the rows' own memory. After a Load that throws the replay may
  // only be destroyed.
  void Save(StateWriter* writer) const;
  void Load(StateReader* reader);
  // One that has the size of what was saved: to be looked at, it has no room for more.
  static std::unique_ptr<Replay> Read(std::uint64_t search_candidates, StateReader* reader);

  struct Episode {
    std::uint64_t first = 0;  // row
    std::uint64_t rows = 0;
    std::uint64_t finished = 0;
  };
  // All of it, oldest first: the episodes, and of every row what it holds.
  const std::vector<Episode>& episodes() const { return episodes_; }
  MatrixView<const float> observations() const {
    return {observations_.get(), rows_, observation_size_};
  }
  MatrixView<const float> actions() const { return {actions_.get(), rows_, action_size_}; }
  View<const float> rewards() const { return {rewards_.get(), rows_}; }
  View<const float> discounts() const { return {discounts_.get(), rows_}; }

 private:
  struct Sizes {
    std::uint64_t observation = 0, action = 0, rows = 0;
    explicit Sizes(StateReader* reader);
  };
  void LoadRows(std::uint64_t rows, StateReader* reader);
  void Append(View<const double> action, double reward, double discount,
              View<const double> observation, bool is_first);
  void MakeRoom();
  std::uint64_t RowOf(std::uint64_t batch_row) const {
    return batch_starts_[batch_row / batch_length_] + batch_row % batch_length_;
  }
  void Set(const RootSearch& search, std::uint64_t row, float* actions, float* weights,
           float* values) const;
  std::uint64_t DrawStart(std::uint64_t length, std::uint64_t longest, std::size_t finished,
                          Random* random) const;

  std::uint64_t observation_size_;
  std::uint64_t action_size_;
  std::uint64_t capacity_;
  std::uint64_t candidates_;  // K
  std::uint64_t rows_ = 0;
  std::uint64_t finished_rows_ = 0;
  std::vector<Episode> episodes_;
  std::unique_ptr<float[]> observations_;
  std::unique_ptr<float[]> actions_;
  std::unique_ptr<float[]> rewards_;
  std::unique_ptr<float[]> discounts_;
  std::unique_ptr<std::uint8_t[]> is_first_;
  std::unique_ptr<float[]> search_actions_, search_weights_, search_values_;  // null if K is 0

  // The batch handed out by Sample.
  std::vector<float> batch_observations_;
  std::vector<float> batch_actions_;
  std::vector<float> batch_rewards_;
  std::vector<float> batch_discounts_;
  std::vector<std::uint8_t> batch_is_first_;
  std::vector<float> batch_search_actions_, batch_search_weights_, batch_search_values_;
  std::vector<std::uint64_t> batch_starts_;  // of its sequences
  std::uint64_t batch_length_ = 0;
};

}  // namespace dreamsearch
