// loaded_planner.h - a planner of a built plugin, as the host would make it.
#pragma once

#include <dlfcn.h>

#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "dreamsearch/plugin.h"
#include "tests/plugins/owned.h"

namespace dreamsearch {

struct Setting {
  template <typename Number>
  requires std::is_arithmetic_v<Number> Setting(const char* setting_name, Number value)
      : name(setting_name), number(static_cast<double>(value)) {}
  Setting(const char* setting_name, const char* value) : name(setting_name), choice(value) {}
  const char* name;
  double number = 0;
  const char* choice = nullptr;
};
using Settings = std::vector<Setting>;

inline const PluginDescriptor& LoadPlugin(const std::string& file) {
  const std::string path = std::string(DREAMSEARCH_TEST_PLUGIN_DIR) + "/" + file + ".so";
  void* library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw std::runtime_error(dlerror());
  const auto entry = reinterpret_cast<PluginEntry>(dlsym(library, kPluginEntrySymbol));
  if (entry == nullptr) throw std::runtime_error(path + " exports no " + kPluginEntrySymbol);
  return *entry();
}

inline std::vector<const ComponentDescriptor*> AllPlanners() {
  std::vector<const ComponentDescriptor*> planners;
  for (const char* file : {"planner_dreamer", "planner_rollout", "planner_mcts", "planner_shooting",
                           "planner_gradient"}) {
    for (const ComponentDescriptor& component : LoadPlugin(file).components) {
      planners.push_back(&component);
    }
  }
  return planners;
}

inline const ComponentDescriptor& FindPlanner(const std::string& name) {
  for (const ComponentDescriptor* component : AllPlanners()) {
    if (component->name == name) return *component;
  }
  throw std::runtime_error("no planner " + name);
}

// The declared defaults with `settings` in their place.
inline std::vector<ParameterValue> Resolve(const ComponentDescriptor& component,
                                           const Settings& settings) {
  std::vector<ParameterValue> values;
  for (const ParameterSpec& spec : component.parameters) {
    values.push_back({spec.name, spec.default_number, spec.default_choice});
  }
  for (const Setting& setting : settings) {
    bool found = false;
    for (ParameterValue& value : values) {
      if (std::strcmp(value.name, setting.name) != 0) continue;
      value.number = setting.number;
      value.choice = setting.choice;
      found = true;
    }
    if (!found) {
      throw std::runtime_error(std::string(component.name) + " has no parameter " + setting.name);
    }
  }
  return values;
}

// An edge of a reported tree, with its own copy of the action.
struct Edge : TreeEdge {
  std::vector<double> a;
};

class CollectTree final : public TreeSink {
 public:
  void Edge(const TreeEdge& edge) noexcept override {
    dreamsearch::Edge copy;
    static_cast<TreeEdge&>(copy) = edge;
    copy.a.assign(edge.action.begin(), edge.action.end());
    edges.push_back(copy);
  }
  std::vector<dreamsearch::Edge> edges;
};

struct Decision {
  Status status;
  std::vector<double> action;
  std::vector<double> metrics;
  PlanResult result;
  std::vector<Edge> tree;
  std::vector<std::vector<double>> policy_actions;
  std::vector<double> policy_weights;
};

struct PlanOptions {
  bool explore = false;
  std::uint64_t seed = 1;
  bool tree = true;
  std::uint64_t policy = 0;  // actions of the improved policy to be asked for
};

class LoadedPlanner {
 public:
  LoadedPlanner(const std::string& name, LatentModel* model, const Settings& settings = {})
      : LoadedPlanner(FindPlanner(name), model, settings) {}
  LoadedPlanner(const ComponentDescriptor& component, LatentModel* model,
                const Settings& settings = {})
      : component_(component), action_size_(model->action_size()) {
    const std::vector<ParameterValue> values = Resolve(component, settings);
    Planner* planner = nullptr;
    const Status made = component.create_planner(
        {{{values.data(), values.size()}}, action_size_, model->latent_bytes()}, &planner);
    if (!made.ok()) throw std::runtime_error(made.message);
    planner_.reset(planner);
    const Status begun = planner_->BeginEpisode(model);
    if (!begun.ok()) throw std::runtime_error(begun.message);
  }

  Planner* operator->() { return planner_.get(); }
  Planner* get() { return planner_.get(); }

  Decision Plan(ConstLatents root, const PlanOptions& options = {}) {
    Decision decision;
    decision.action.assign(action_size_, -7);
    decision.metrics.assign(component_.metrics.size, -7);
    decision.result.action = {decision.action.data(), decision.action.size()};
    decision.result.metrics = {decision.metrics.data(), decision.metrics.size()};
    std::vector<double> policy_actions(options.policy * action_size_, -7);
    decision.policy_weights.assign(options.policy, -7);
    PlanRequest request;
    request.root = root;
    request.explore = options.explore;
    request.seed = options.seed;
    decision.status = planner_->Plan(request, &decision.result);
    if (!decision.status.ok()) return decision;
    auto* trees = ExtensionOf<TreeReporting>(planner_.get());
    if (options.tree && trees != nullptr) {
      CollectTree tree;
      trees->ReportTree(&tree);
      decision.tree = std::move(tree.edges);
    }
    auto* policies = ExtensionOf<PolicyReporting>(planner_.get());
    if (options.policy > 0 && policies != nullptr) {
      decision.status =
          policies->ReportPolicy({policy_actions.data(), options.policy, action_size_},
                                 {decision.policy_weights.data(), options.policy});
    }
    for (auto at = policy_actions.begin(); at != policy_actions.end();) {
      const auto end = at + static_cast<std::ptrdiff_t>(action_size_);
      decision.policy_actions.emplace_back(at, end);
      at = end;
    }
    return decision;
  }

  double Metric(const Decision& decision, const char* name) const {
    for (std::uint64_t i = 0; i < component_.metrics.size; ++i) {
      if (std::strcmp(component_.metrics[i].name, name) == 0) return decision.metrics[i];
    }
    throw std::runtime_error(std::string("no metric ") + name);
  }

 private:
  const ComponentDescriptor& component_;
  const std::uint64_t action_size_;
  Owned<Planner> planner_;
};

class Bytes final : public ByteSink, public ByteSource {
 public:
  Status Write(const void* data, std::uint64_t size) noexcept override {
    const auto* bytes = static_cast<const std::byte*>(data);
    buffer.insert(buffer.end(), bytes, bytes + size);
    return OkStatus();
  }
  Status Read(void* data, std::uint64_t size) noexcept override {
    if (buffer.size() - at < size) return Error(StatusCode::kDataLoss, "too few bytes");
    std::memcpy(data, buffer.data() + at, size);
    at += size;
    return OkStatus();
  }
  std::vector<std::byte> buffer;
  std::uint64_t at = 0;
};

// The edges of the root, in the order in which they were created.
inline std::vector<Edge> RootEdges(const Decision& decision) {
  std::vector<Edge> edges;
  for (const Edge& edge : decision.tree) {
    if (edge.parent == -1) edges.push_back(edge);
  }
  return edges;
}

}  // namespace dreamsearch
