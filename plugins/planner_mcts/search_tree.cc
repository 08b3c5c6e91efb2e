#include "search_tree.h"

#include <cassert>
#include <limits>
#include <utility>

namespace dreamsearch {

SearchTree::SearchTree(std::uint64_t max_nodes, std::uint64_t max_edges, std::uint64_t action_size,
                       std::uint64_t latent_bytes)
    : action_size_(action_size), latent_bytes_(latent_bytes) {
  if (max_nodes >= kNone || max_edges >= kNone) {
    throw std::length_error("the tree would need more than 2^32 - 2 nodes or edges");
  }
  latents_ = LatentBuffer(max_nodes, latent_bytes);
  for (std::vector<Index>* array :
       {&node_parent_edge_, &node_first_child_, &node_last_child_, &node_child_count_, &node_depth_,
        &node_visits_, &node_in_flight_}) {
    array->resize(max_nodes);
  }
  for (std::vector<double>* array :
       {&node_return_sum_, &node_reward_, &node_discount_, &node_value_}) {
    array->resize(max_nodes);
  }
  for (std::vector<Index>* array :
       {&edge_parent_, &edge_next_, &edge_child_, &edge_visits_, &edge_in_flight_}) {
    array->resize(max_edges);
  }
  edge_q_.resize(max_edges);
  actions_.resize(max_edges * action_size);
  kept_.resize(std::max(max_nodes, max_edges));
}

void SearchTree::Reset(ConstLatents root) noexcept {
  Clear();
  q_min_ = std::numeric_limits<double>::infinity();
  q_max_ = -std::numeric_limits<double>::infinity();
  NewNode(kNone);
  node_reward_[kRoot] = node_discount_[kRoot] = node_value_[kRoot] = 0;
  latents_.Set(kRoot, root);
  MarkEvaluated();
}

SearchTree::Index SearchTree::AddEdges(Index node, Index count) noexcept {
  assert(count > 0 && edge_count_ + count <= edge_q_.size());
  const Index first = edge_count_;
  edge_count_ += count;
  for (Index edge = first; edge < edge_count_; ++edge) {
    edge_parent_[edge] = node;
    edge_next_[edge] = edge + 1 < edge_count_ ? edge + 1 : kNone;
    edge_child_[edge] = kNone;
    edge_visits_[edge] = 0;
    edge_in_flight_[edge] = 0;
    edge_q_[edge] = 0;
  }
  if (node_first_child_[node] == kNone) {
    node_first_child_[node] = first;
  } else {
    edge_next_[node_last_child_[node]] = first;
  }
  node_last_child_[node] = edge_count_ - 1;
  node_child_count_[node] += count;
  return first;
}

SearchTree::Index SearchTree::NewNode(Index edge) noexcept {
  assert(node_count_ < node_value_.size());
  const Index node = node_count_++;
  node_parent_edge_[node] = edge;
  node_first_child_[node] = kNone;
  node_last_child_[node] = kNone;
  node_child_count_[node] = 0;
  node_depth_[node] = edge == kNone ? 0 : node_depth_[edge_parent_[edge]] + 1;
  node_visits_[node] = 0;
  node_in_flight_[node] = 0;
  node_return_sum_[node] = 0;
  if (edge != kNone) edge_child_[edge] = node;
  return node;
}

void SearchTree::BackUp(Index leaf, bool edge_reward) noexcept {
  double g = node_value_[leaf];
  Index node = leaf;
  for (Index edge = node_parent_edge_[node]; edge != kNone; edge = node_parent_edge_[node]) {
    const double after = g;
    g = node_reward_[node] + node_discount_[node] * g;
    const double taken = edge_reward ? g : after;
    const double visits = edge_visits_[edge];
    const double q = (visits * edge_q_[edge] + taken) / (visits + 1);
    edge_q_[edge] = q;
    ++edge_visits_[edge];
    q_min_ = std::min(q_min_, q);
    q_max_ = std::max(q_max_, q);
    node = edge_parent_[edge];
    ++node_visits_[node];
    node_return_sum_[node] += taken;
  }
}

void SearchTree::AddInFlight(Index leaf, std::int32_t change) noexcept {
  const Index step = static_cast<Index>(change);
  Index node = leaf;
  for (Index edge = node_parent_edge_[node]; edge != kNone; edge = node_parent_edge_[node]) {
    edge_in_flight_[edge] += step;
    node = edge_parent_[edge];
    node_in_flight_[node] += step;
  }
}

void SearchTree::RecomputeQRange() noexcept {
  q_min_ = std::numeric_limits<double>::infinity();
  q_max_ = -std::numeric_limits<double>::infinity();
  for (Index edge = 0; edge < edge_count_; ++edge) {
    if (edge_visits_[edge] == 0) continue;
    q_min_ = std::min(q_min_, edge_q_[edge]);
    q_max_ = std::max(q_max_, edge_q_[edge]);
  }
}

// New indices keep the order of the old ones and are never larger, so both arrays
// close ranks from the front, in place. kept_ first maps nodes, then edges.
void SearchTree::KeepSubtree(Index root) noexcept {
  assert(!pending(root));
  const Index root_depth = node_depth_[root];
  Index nodes = 0;
  for (Index node = 0; node < node_count_; ++node) {
    const Index edge = node_parent_edge_[node];
    const bool keep = node == root || (edge != kNone && kept_[edge_parent_[edge]] != kNone);
    kept_[node] = keep ? nodes++ : kNone;
  }
  for (Index node = root; node < node_count_; ++node) {
    const Index to = kept_[node];
    if (to == kNone) continue;
    if (to != node) latents_.Set(to, std::as_const(latents_).row(node));
    node_parent_edge_[to] = node == root ? kNone : node_parent_edge_[node];
    node_first_child_[to] = node_first_child_[node];
    node_last_child_[to] = node_last_child_[node];
    node_child_count_[to] = node_child_count_[node];
    node_depth_[to] = node_depth_[node] - root_depth;
    node_visits_[to] = node_visits_[node];
    node_in_flight_[to] = node_in_flight_[node];
    node_return_sum_[to] = node_return_sum_[node];
    node_reward_[to] = node_reward_[node];
    node_discount_[to] = node_discount_[node];
    node_value_[to] = node_value_[node];
  }
  node_reward_[kRoot] = node_discount_[kRoot] = 0;
  for (Index edge = 0; edge < edge_count_; ++edge) {
    edge_parent_[edge] = kept_[edge_parent_[edge]];
    if (edge_child_[edge] != kNone) edge_child_[edge] = kept_[edge_child_[edge]];
  }

  Index edges = 0;
  for (Index edge = 0; edge < edge_count_; ++edge) {
    kept_[edge] = edge_parent_[edge] != kNone ? edges++ : kNone;
  }
  const auto renamed = [this](Index edge) { return edge == kNone ? kNone : kept_[edge]; };
  for (Index edge = 0; edge < edge_count_; ++edge) {
    const Index to = kept_[edge];
    if (to == kNone) continue;
    edge_parent_[to] = edge_parent_[edge];
    edge_next_[to] = renamed(edge_next_[edge]);
    edge_child_[to] = edge_child_[edge];
    edge_visits_[to] = edge_visits_[edge];
    edge_in_flight_[to] = edge_in_flight_[edge];
    edge_q_[to] = edge_q_[edge];
    std::copy_n(actions_.data() + edge * action_size_, action_size_,
                actions_.data() + to * action_size_);
  }
  for (Index node = 0; node < nodes; ++node) {
    node_parent_edge_[node] = renamed(node_parent_edge_[node]);
    node_first_child_[node] = renamed(node_first_child_[node]);
    node_last_child_[node] = renamed(node_last_child_[node]);
  }
  node_count_ = evaluated_count_ = nodes;
  edge_count_ = edges;
  RecomputeQRange();
}

void SearchTree::Report(TreeSink* sink) const noexcept {
  for (Index edge = 0; edge < edge_count_; ++edge) {
    const Index parent = edge_parent_[edge];
    const Index up = node_parent_edge_[parent];
    const Index child = edge_child_[edge];
    TreeEdge out;
    out.parent = up == kNone ? -1 : static_cast<std::int64_t>(up);
    out.action = {actions_.data() + edge * action_size_, action_size_};
    out.visits = edge_visits_[edge];
    out.q = edge_q_[edge];
    out.prior = 1.0 / node_child_count_[parent];
    out.expanded = child != kNone;
    if (out.expanded) {
      out.reward = node_reward_[child];
      out.discount = node_discount_[child];
      out.value = node_value_[child];
    }
    sink->Edge(out);
  }
}

// What the tree carries besides counts: simulations in flight are none, children,
// depths and extremes follow from the rest but are short, so they are written too.
template <typename Self, typename F>
Status SearchTree::ForEachArray(Self& self, F f) {
  const std::uint64_t nodes = self.node_count_;
  const std::uint64_t edges = self.edge_count_;
  for (auto* array : {&self.node_parent_edge_, &self.node_first_child_, &self.node_last_child_,
                      &self.node_child_count_, &self.node_depth_, &self.node_visits_}) {
    if (Status status = f(array->data(), nodes * sizeof(Index)); !status.ok()) return status;
  }
  for (auto* array :
       {&self.node_return_sum_, &self.node_reward_, &self.node_discount_, &self.node_value_}) {
    if (Status status = f(array->data(), nodes * sizeof(double)); !status.ok()) return status;
  }
  for (auto* array :
       {&self.edge_parent_, &self.edge_next_, &self.edge_child_, &self.edge_visits_}) {
    if (Status status = f(array->data(), edges * sizeof(Index)); !status.ok()) return status;
  }
  if (Status status = f(self.edge_q_.data(), edges * sizeof(double)); !status.ok()) return status;
  if (Status status = f(self.actions_.data(), edges * self.action_size_ * sizeof(double));
      !status.ok()) {
    return status;
  }
  return f(self.latents_.row(0).data, nodes * self.latent_bytes_);
}

Status SearchTree::Save(ByteSink* sink) const noexcept {
  if (Status status = WriteValue(sink, node_count_); !status.ok()) return status;
  if (Status status = WriteValue(sink, edge_count_); !status.ok()) return status;
  return ForEachArray(
      *this, [sink](const void* data, std::uint64_t size) { return sink->Write(data, size); });
}

Status SearchTree::Load(ByteSource* source) noexcept {
  Clear();
  Index nodes = 0, edges = 0;
  if (Status status = ReadValue(source, &nodes); !status.ok()) return status;
  if (Status status = ReadValue(source, &edges); !status.ok()) return status;
  if (nodes > node_value_.size() || edges > edge_q_.size()) {
    return Error(StatusCode::kDataLoss,
                 "the saved tree has %u nodes and %u edges, these settings allow %zu and %zu",
                 nodes, edges, node_value_.size(), edge_q_.size());
  }
  node_count_ = nodes;
  edge_count_ = edges;
  Status status = ForEachArray(
      *this, [source](void* data, std::uint64_t size) { return source->Read(data, size); });
  bool valid = status.ok();
  const auto below = [](Index index, Index count) { return index == kNone || index < count; };
  for (Index node = 0; valid && node < nodes; ++node) {
    node_in_flight_[node] = 0;
    valid = below(node_parent_edge_[node], edges) && below(node_first_child_[node], edges) &&
            below(node_last_child_[node], edges) &&
            (node_parent_edge_[node] == kNone) == (node == kRoot);
  }
  for (Index edge = 0; valid && edge < edges; ++edge) {
    edge_in_flight_[edge] = 0;
    // Growing indices rule out cycles.
    const Index parent = edge_parent_[edge], next = edge_next_[edge], child = edge_child_[edge];
    valid = parent < nodes && below(next, edges) && (next == kNone || next > edge) &&
            below(child, nodes) && (child == kNone || child > parent);
  }
  if (!valid) {
    Clear();
    return status.ok() ? Error(StatusCode::kDataLoss, "the saved tree contradicts itself") : status;
  }
  evaluated_count_ = node_count_;
  RecomputeQRange();
  return OkStatus();
}

}  // namespace dreamsearch
