// search_tree.h - the tree of one decision: counts, values, actions, latents.
//
// A node is a latent that was evaluated, an edge an action to try at a node. Node
// 0 is the root; every other node hangs on one edge, which is then *expanded*.
// The children of a node are a list of edges in the order of their creation.
// Indices grow with time: a parent's is smaller than its descendants'.
//
// A node taken by NewNode is *pending* until MarkEvaluated: its latent, reward,
// discount and value are still to come from the model. Several may be pending at
// once; AddInFlight then makes their paths look less attractive.
//
// Memory   flat arrays, reserved once for the largest tree; nothing here
//          allocates after the constructor.
// Errors   sizes are the caller's promise and asserted; only Load can fail.
#pragma once

#include <cstdint>
#include <vector>

#include "dreamsearch/planning.h"

namespace dreamsearch {

class SearchTree {
 public:
  using Index = std::uint32_t;
  static constexpr Index kNone = UINT32_MAX;
  static constexpr Index kRoot = 0;

  // Throws std::bad_alloc, std::length_error.
  SearchTree(std::uint64_t max_nodes, std::uint64_t max_edges, std::uint64_t action_size,
             std::uint64_t latent_bytes);

  // Forgets everything; the root is evaluated and has no children.
  void Reset(ConstLatents root) noexcept;
  // Replaces the root's latent, keeping all that hangs below it.
  void SetRootLatent(ConstLatents root) noexcept { latents_.Set(kRoot, root); }
  bool empty() const noexcept { return node_count_ == 0; }
  void Clear() noexcept { node_count_ = edge_count_ = evaluated_count_ = 0; }

  // --- growth ---

  // Appends `count` children to `node` and returns the first of them; the others
  // follow it. Their actions are for the caller to fill.
  Index AddEdges(Index node, Index count) noexcept;
  // Hangs a pending node on an unexpanded edge.
  Index NewNode(Index edge) noexcept;
  // All pending nodes have their latents, rewards, discounts and values.
  void MarkEvaluated() noexcept { evaluated_count_ = node_count_; }

  // --- nodes ---

  Index node_count() const noexcept { return node_count_; }
  Index evaluated_count() const noexcept { return evaluated_count_; }
  bool pending(Index node) const noexcept { return node >= evaluated_count_; }
  Index parent_edge(Index node) const noexcept { return node_parent_edge_[node]; }
  Index first_child(Index node) const noexcept { return node_first_child_[node]; }
  Index child_count(Index node) const noexcept { return node_child_count_[node]; }
  // Transitions from the root.
  Index depth(Index node) const noexcept { return node_depth_[node]; }
  // n(s) = sum_b N(s, b), without simulations in flight.
  Index visits(Index node) const noexcept { return node_visits_[node]; }
  Index in_flight(Index node) const noexcept { return node_in_flight_[node]; }
  double value(Index node) const noexcept { return node_value_[node]; }
  // sum_b N(s, b) Q(s, b) / n(s); n(s) must not be 0.
  double mean_q(Index node) const noexcept { return node_return_sum_[node] / node_visits_[node]; }
  // Where the model writes the `count` nodes from `first` on.
  Latents latents(Index first, Index count) noexcept { return latents_.middle_rows(first, count); }
  View<double> rewards(Index first, Index count) noexcept {
    return {node_reward_.data() + first, count};
  }
  View<double> discounts(Index first, Index count) noexcept {
    return {node_discount_.data() + first, count};
  }
  View<double> values(Index first, Index count) noexcept {
    return {node_value_.data() + first, count};
  }

  // --- edges ---

  Index edge_count() const noexcept { return edge_count_; }
  Index parent(Index edge) const noexcept { return edge_parent_[edge]; }
  Index next_sibling(Index edge) const noexcept { return edge_next_[edge]; }
  // The node it leads to, kNone while unexpanded.
  Index child(Index edge) const noexcept { return edge_child_[edge]; }
  // N and Q, without simulations in flight.
  Index edge_visits(Index edge) const noexcept { return edge_visits_[edge]; }
  Index edge_in_flight(Index edge) const noexcept { return edge_in_flight_[edge]; }
  double q(Index edge) const noexcept { return edge_q_[edge]; }
  MatrixView<double> actions(Index first, Index count) noexcept {
    return {actions_.data() + first * action_size_, count, action_size_};
  }

  // --- statistics ---

  // Backs up v(leaf) along the path to the root. Walking up, G <- r + discount * G
  // and every edge takes in the new G; with `edge_reward` false it takes in the G
  // before its own reward (the equation printed in MuZero's and Koul's papers).
  void BackUp(Index leaf, bool edge_reward) noexcept;
  // Adds `change` (1 or -1) simulations in flight along the path to the root.
  void AddInFlight(Index leaf, std::int32_t change) noexcept;

  // The extremes of every Q written since Reset. `q_scale` is 1 / (max - min), or
  // 0 while they are equal, so that (q - q_min) * q_scale is the normalised Q.
  double q_min() const noexcept { return q_min_; }
  double q_scale() const noexcept { return q_max_ > q_min_ ? 1 / (q_max_ - q_min_) : 0; }

  // Makes `node` the root and drops all that is not below it. The extremes become
  // those of the kept Qs.
  void KeepSubtree(Index node) noexcept;

  void Report(TreeSink* sink) const noexcept;
  Status Save(ByteSink* sink) const noexcept;
  Status Load(ByteSource* source) noexcept;

 private:
  void RecomputeQRange() noexcept;
  // Calls f on every array of a node or an edge, with its count in use.
  template <typename Self, typename F>
  static Status ForEachArray(Self& self, F f);

  const std::uint64_t action_size_;
  const std::uint64_t latent_bytes_;
  Index node_count_ = 0;
  Index evaluated_count_ = 0;
  Index edge_count_ = 0;
  double q_min_ = 0;
  double q_max_ = 0;

  LatentBuffer latents_;                 // [nodes]
  std::vector<Index> node_parent_edge_;  // [nodes]
  std::vector<Index> node_first_child_;
  std::vector<Index> node_last_child_;
  std::vector<Index> node_child_count_;
  std::vector<Index> node_depth_;
  std::vector<Index> node_visits_;
  std::vector<Index> node_in_flight_;
  std::vector<double> node_return_sum_;  // sum of the G's taken in by its edges
  std::vector<double> node_reward_;      // of the transition that leads here
  std::vector<double> node_discount_;    // of the transition that leads here
  std::vector<double> node_value_;

  std::vector<Index> edge_parent_;  // [edges]
  std::vector<Index> edge_next_;
  std::vector<Index> edge_child_;
  std::vector<Index> edge_visits_;
  std::vector<Index> edge_in_flight_;
  std::vector<double> edge_q_;
  std::vector<double> actions_;  // [edges, A]
  std::vector<Index> kept_;      // [max(nodes, edges)]: scratch of KeepSubtree
};

}  // namespace dreamsearch
