// decision_tree.h - a decision's search tree, to keep and to look at.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "dreamsearch/planner.h"
#include "host/acting/agent.h"

namespace dreamsearch {

// Keeps what a planner reports.
class TreeCollector final : public TreeSink {
 public:
  struct Kept {
    std::int64_t parent = -1;
    std::vector<double> action;
    std::uint64_t visits = 0;
    double q = 0, prior = 0, reward = 0, discount = 0, value = 0;
    bool expanded = false;
  };

  void Edge(const TreeEdge& edge) noexcept override;
  void Clear() {
    edges_.clear();
    faulty_ = false;
  }

  const std::vector<Kept>& edges() const { return edges_; }
  // Whether memory ran out or an edge came before its parent.
  bool faulty() const { return faulty_; }

 private:
  std::vector<Kept> edges_;
  bool faulty_ = false;
};

// The tree of one decision as JSON: `action`, `root` (value, visits, visit_entropy in
// nats, simulations, nodes, depth and the planner's `metrics` with unit and help),
// `chosen_edge` with `chosen_is_exact`, and `edges` in the planner's order, parents
// first, each with the fields of TreeEdge. chosen_edge is the root's edge with the
// played action or, where there is none, the nearest.
nlohmann::json TreeJson(const TreeCollector& tree, View<const double> action,
                        const Decision& decision, const std::vector<double>& metrics,
                        const Records<MetricSpec>& metric_specs);

}  // namespace dreamsearch
