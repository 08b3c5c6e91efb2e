// planner.h - the interface a planner plugin implements.
//
// A planner picks one action by searching ahead in the latent space of a
// LatentModel. It never sees the simulator, the observation or the results
// database, so every planner runs on every model and every task.
//
// Shapes   A is the task's action size. A latent is opaque: copy it, keep it,
//          hand it back to the model it came from; never read it.
// Units    actions lie in [-1, 1]; a value is the discounted sum of the rewards
//          still to come, one reward per decision (after action repeat).
// Memory   views belong to the caller and are valid only during the call. Plan
//          allocates nothing once it has run for the first time.
// Threads  one thread drives an instance at a time; instances share nothing. Plan is
//          plain sequential code for one root, but a host that plans several roots lets
//          their instances take turns: a call of the model may lay Plan aside while
//          other instances plan on the same thread, each on a stack of its own (of
//          8 MiB). So across a call of the model hold no lock, and keep nothing in
//          thread-local variables.
// Errors   every call returns a Status and lets no exception out. Laws P1-P13: sdk/README.md.
#pragma once

#include <cstdint>

#include "dreamsearch/extension.h"
#include "dreamsearch/model.h"
#include "dreamsearch/parameter.h"
#include "dreamsearch/sized.h"
#include "dreamsearch/status.h"
#include "dreamsearch/stream.h"
#include "dreamsearch/view.h"

namespace dreamsearch {

struct PlanRequest {
  ConstLatents root;                   // [1, latent_bytes]
  bool explore = false;                // add exploration noise
  std::uint64_t seed = 0;              // decides every draw of this decision
  std::uint64_t decision = 0;          // index in the episode
  std::uint64_t environment_step = 0;  // environment steps the run has made
  std::uint64_t struct_size = sizeof(PlanRequest);
};

// It comes with these values: set each field alone.
struct PlanResult {
  View<double> action;            // [A], filled by Plan, each in [-1, 1]
  View<double> metrics;           // one for each MetricSpec of the component, filled by Plan
  double value = 0;               // the planner's estimate of the root's value
  std::uint32_t simulations = 0;  // trajectories or tree simulations made
  std::uint32_t nodes = 0;        // latents evaluated and kept
  std::uint32_t depth = 0;        // most transitions from the root
  std::uint64_t struct_size = sizeof(PlanResult);

  PlanResult& operator=(const PlanResult&) = delete;  // the caller's may be shorter
};

class Planner {
 public:
  // Forgets the episode before (P4) and plans with `model` from now on. The model
  // outlives the episode.
  //   kInvalidArgument     the model's sizes are not those the planner was made for.
  //   kFailedPrecondition  the planner needs an extension that the model does not offer.
  virtual Status BeginEpisode(LatentModel* model) noexcept = 0;

  // Chooses the action of one decision (P3: all set; P4: seeds; P8: memory; P10: not finite).
  //   kFailedPrecondition  no episode has begun.
  //   kInvalidArgument     a view has the wrong size.
  //   any error of the model, passed on; *result is then unset.
  virtual Status Plan(const PlanRequest& request, PlanResult* result) noexcept = 0;

  // What it carries from one decision to the next (a warm start, a kept tree); P6, P7.
  // Load is called after BeginEpisode.
  virtual Status Save(ByteSink* sink) const noexcept = 0;
  virtual Status Load(ByteSource* source) noexcept = 0;

  // The extension of that name, TreeReporting or PolicyReporting; null: not offered. The calls
  // of both are about the last Plan, if it succeeded: they come right after it, before any other
  // call of the planner, and ask nothing of the model.
  virtual void* Extension(const char* name) noexcept {
    static_cast<void>(name);
    return nullptr;
  }

  virtual void Destroy() noexcept = 0;

 protected:
  ~Planner() = default;
};

// One edge of a search tree and the node it leads to, for pictures and tests.
struct TreeEdge {
  std::int64_t parent = -1;   // index of the parent's edge; -1 at the root
  View<const double> action;  // [A]
  std::uint64_t visits = 0;   // N
  double q = 0;               // Q; 0 while N is 0
  double prior = 0;           // P
  double reward = 0;          // R: r(s'); 0 while not expanded
  double discount = 0;        // discount of the transition; 0 while not expanded
  double value = 0;           // v(s'); 0 while not expanded
  bool expanded = false;
  std::uint64_t struct_size = sizeof(TreeEdge);
};

// Receives the edges of a finished search, parents before children.
class TreeSink {
 public:
  virtual void Edge(const TreeEdge& edge) noexcept = 0;

 protected:
  ~TreeSink() = default;
};

// Extension: shows the search tree, for `runner explain` and --record-trees.
class TreeReporting {
 public:
  static constexpr const char* kName = "tree/1";

  virtual void ReportTree(TreeSink* sink) noexcept = 0;

 protected:
  ~TreeReporting() = default;
};

// Extension: the improved policy, for run.search_targets. Declared by the trait kReportsPolicy.
class PolicyReporting {
 public:
  static constexpr const char* kName = "policy/1";

  // What the search would have the actor do at the root, before the noise of exploration on the
  // played action: its K heaviest actions, heaviest first; the weights sum to 1, rows that are
  // not needed have weight 0. actions: [K, A], each in [-1, 1]; weights: [K].
  //   kInvalidArgument     a view has the wrong size.
  virtual Status ReportPolicy(MatrixView<double> actions, View<double> weights) noexcept = 0;

 protected:
  ~PolicyReporting() = default;
};

}  // namespace dreamsearch
