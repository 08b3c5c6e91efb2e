#include "host/acting/decision_tree.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace dreamsearch {

void TreeCollector::Edge(const TreeEdge& edge) noexcept {
  try {
    if (edge.parent < -1 || edge.parent >= static_cast<std::int64_t>(edges_.size())) {
      faulty_ = true;
      return;
    }
    Kept kept;
    kept.parent = edge.parent;
    kept.action.assign(edge.action.begin(), edge.action.end());
    kept.visits = edge.visits;
    kept.q = edge.q;
    kept.prior = edge.prior;
    kept.reward = edge.reward;
    kept.discount = edge.discount;
    kept.value = edge.value;
    kept.expanded = edge.expanded;
    edges_.push_back(std::move(kept));
  } catch (...) {
    faulty_ = true;
  }
}

nlohmann::json TreeJson(const TreeCollector& tree, View<const double> action,
                        const Decision& decision, const std::vector<double>& metrics,
                        const Records<MetricSpec>& metric_specs) {
  nlohmann::json json;
  json["action"] = std::vector<double>(action.begin(), action.end());
  std::int64_t chosen = -1;
  double nearest = std::numeric_limits<double>::infinity();
  double visits = 0;
  nlohmann::json& edges = json["edges"] = nlohmann::json::array();
  for (std::size_t i = 0; i < tree.edges().size(); ++i) {
    const auto& edge = tree.edges()[i];
    edges.push_back({{"parent", edge.parent},
                     {"action", edge.action},
                     {"visits", edge.visits},
                     {"q", edge.q},
                     {"prior", edge.prior},
                     {"reward", edge.reward},
                     {"discount", edge.discount},
                     {"value", edge.value},
                     {"expanded", edge.expanded}});
    if (edge.parent != -1) continue;
    visits += static_cast<double>(edge.visits);
    double distance = 0;
    for (std::size_t k = 0; k < edge.action.size() && k < action.size; ++k) {
      distance += (edge.action[k] - action[k]) * (edge.action[k] - action[k]);
    }
    if (distance < nearest) {
      nearest = distance;
      chosen = static_cast<std::int64_t>(i);
    }
  }
  double entropy = 0;
  for (const auto& edge : tree.edges()) {
    if (edge.parent != -1 || edge.visits == 0) continue;
    const double share = static_cast<double>(edge.visits) / visits;
    entropy -= share * std::log(share);
  }
  json["chosen_edge"] = chosen;
  json["chosen_is_exact"] = nearest == 0;
  nlohmann::json& root = json["root"];
  root["value"] = decision.value;
  root["visits"] = visits;
  root["visit_entropy"] = entropy + 0.0;
  root["simulations"] = decision.simulations;
  root["nodes"] = decision.nodes;
  root["depth"] = decision.depth;
  root["metrics"] = nlohmann::json::array();
  for (std::size_t i = 0; i < metrics.size() && i < metric_specs.size; ++i) {
    root["metrics"].push_back({{"name", metric_specs[i].name},
                               {"unit", metric_specs[i].unit},
                               {"help", metric_specs[i].help},
                               {"value", metrics[i]}});
  }
  return json;
}

}  // namespace dreamsearch
