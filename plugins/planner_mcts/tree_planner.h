// tree_planner.h - what every tree search here shares: the loop of simulations.
//
// A simulation walks from the root along the edges the derived class chooses to
// one that is not expanded, asks the model for the transition and the value of the
// new latent, and backs the return up. Up to `leaf_batch` leaves are collected
// before the model is called once for all of them; simulations in flight are then
// counted as virtual losses (Chaslot, Winands, van den Herik 2008). With
// leaf_batch = 1 none is ever in flight: the plain search, in the same code.
//
// The value a search reports is the Q of the root edge it chose: the mean return of
// the simulations that began with that action, before exploration noise on it.
#pragma once

#include <vector>

#include "dreamsearch/planning.h"
#include "search_tree.h"

namespace dreamsearch {

// Parameters that tree searches share.
struct TreeSettings : ValueUse {
  std::uint64_t simulations;
  std::uint64_t leaf_batch;
  SearchTree::Index equal_depth;
  double noise_std;
  bool edge_reward;
  bool reuse_tree;      // false where it is not declared
  double root_uniform;  // 0 where it is not declared
};
inline constexpr auto kSimulationsParameter = Bind<&TreeSettings::simulations>(IntParameter(
    "simulations", 50, 1, 1000000, "simulations", "Simulations a decision (Koul et al. 2020)."));
inline constexpr auto kNoiseParameter = Bind<&TreeSettings::noise_std>(
    RealParameter("noise_std", 0.3, 0, 10, "",
                  "Standard deviation of the Gaussian noise on every sampled action and on the "
                  "played one while exploring (Koul et al. 2020)."));
inline constexpr auto kLeafBatchParameter = Bind<&TreeSettings::leaf_batch>(
    IntParameter("leaf_batch", 1, 1, 4096, "leaves",
                 "Leaves collected with virtual loss before one call of the model evaluates them; "
                 "1 is the plain search."));
inline constexpr auto kReuseParameter = Bind<&TreeSettings::reuse_tree>(
    BoolParameter("reuse_tree", false,
                  "Keep the chosen action's subtree for the next decision; its visits count "
                  "towards the simulations. Dropped when noise changed the action."));
inline constexpr auto kEqualDepthParameter = Bind<&TreeSettings::equal_depth>(IntParameter(
    "equal_depth", 0, 0, 1000, "transitions",
    "Carry each leaf on by the actor's mode to this depth below the root before its "
    "value is asked, so that all returns look equally far ahead, as those of `rollout` "
    "do; 0: its value at once (Koul et al. 2020)."));
inline constexpr auto kRootUniformParameter = Bind<&TreeSettings::root_uniform>(RealParameter(
    "root_uniform", 0, 0, 1, "",
    "Share of the root's actions that are drawn uniformly from [-1, 1]^A and not from the actor, "
    "as a third of those of `rollout` are; 0: none (Koul et al. 2020)."));
inline constexpr auto kEdgeRewardParameter = Bind<&TreeSettings::edge_reward>(
    BoolParameter("edge_reward", true,
                  "Count an edge's own reward in its Q; false is the equation as printed in the "
                  "MuZero paper (Schrittwieser et al. 2020)."));

enum TreeMetric {
  kRootVisitEntropy,
  kModeDistance,
  kRootChildren,
  kMeanLeafDepth,
  kQGain,
  kTreeMetricCount
};
constexpr MetricSpec kTreeMetrics[] = {
    {"root_visit_entropy", "nats", "Entropy of the visit distribution over the root's actions."},
    {"mode_distance", "", "Euclidean distance of the played action from the actor's mode action."},
    {"root_children", "actions", "Actions tried or kept at the root."},
    {"mean_leaf_depth", "transitions", "Mean depth of the nodes this decision added."},
    {"q_gain", "", "Q of the chosen root action above the visit-weighted mean of the root's Qs."},
};
static_assert(std::size(kTreeMetrics) == kTreeMetricCount);

class TreePlanner : public Offers<Planner, TreeReporting, PolicyReporting> {
 public:
  using Index = SearchTree::Index;

  Status BeginEpisode(LatentModel* model) noexcept final;
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept final;
  void ReportTree(TreeSink* sink) noexcept final { tree_.Report(sink); }
  Status ReportPolicy(MatrixView<double> policy, View<double> weights) noexcept final;
  // The kept tree, if the option is on.
  Status Save(ByteSink* sink) const noexcept final;
  Status Load(ByteSource* source) noexcept final;
  void Destroy() noexcept final { delete this; }

 protected:
  // The tree has room for `max_edges` edges and simulations + 1 nodes.
  TreePlanner(const PlannerContext& context, const TreeSettings& settings, std::uint64_t max_edges);
  virtual ~TreePlanner() = default;

  // Called before a decision's first simulation; the tree has its root.
  virtual Status BeginSearch() noexcept { return OkStatus(); }
  // Chooses the edge a simulation follows at an evaluated node, after adding
  // children where the node should have more.
  virtual Status ChooseEdge(Index node, Index* edge) noexcept = 0;
  // Called when a simulation was backed up from `leaf`.
  virtual void EndSimulation(Index leaf) noexcept { static_cast<void>(leaf); }
  // The root edge to play after the last simulation; a visited one.
  virtual Index ChoosePlayed() noexcept = 0;
  // How much the improved policy plays the root's i-th action: its share of the visits, unless
  // a class knows better. Called after ChoosePlayed, in any unit.
  virtual double PolicyWeight(Index i, Index edge) const noexcept {
    static_cast<void>(i);
    return tree_.edge_visits(edge);
  }

  // Samples actions from the actor at `node`, noisy while exploring, and at the root a share of
  // them from all actions. The draws follow from the decision's seed and `stream`.
  Status SampleActions(Index node, std::uint64_t stream, MatrixView<double> actions) noexcept;
  // Adds `count` children to `node` with sampled actions.
  Status AddSampledEdges(Index node, Index count, Index* first) noexcept;
  // The visited root edge with the largest Q, the first created of equals.
  Index LargestQ() const noexcept;

  std::uint64_t simulations() const noexcept { return settings_.simulations; }
  bool exploring() const noexcept { return explore_; }
  // A seed of the present decision for draws of the derived class.
  std::uint64_t SearchSeed() const noexcept;
  // The value of the nodes [first, first + count), as the search uses values.
  Status AskValues(Index first, Index count) noexcept;

  SearchTree tree_;

 private:
  // Before anything but a report: of the last decision's tree what the next one keeps is left.
  void KeepOfLastDecision() noexcept;
  Status Search(std::uint64_t budget) noexcept;
  Status SelectLeaf(Index* leaf, bool* collided) noexcept;
  Status EvaluatePending() noexcept;
  // The values of the nodes [first, first + count), by the actor's rollouts to equal_depth.
  Status RollOut(Index first, Index count) noexcept;
  double RootVisitEntropy() const noexcept;

  const PlannerSizes sizes_;
  const TreeSettings settings_;
  SearchValues values_;
  LatentModel* model_ = nullptr;

  // The last decision's tree is still whole; the next one begins with this root edge's subtree,
  // kNone with nothing.
  bool decided_ = false;
  Index kept_edge_ = SearchTree::kNone;

  // Of the present decision.
  bool explore_ = false;
  std::uint64_t seed_ = 0;

  LatentBuffer batch_latents_;         // [leaf_batch], unused when it is 1
  std::vector<std::uint64_t> seeds_;   // [leaf_batch]
  std::vector<double> batch_actions_;  // [leaf_batch, A]
  // Of rollouts, unused without them; rows are leaves, those with the longest way first.
  LatentBuffer rollout_latents_[2];
  std::vector<Index> rollout_order_;
  std::vector<double> rollout_actions_, rollout_rewards_, rollout_discounts_, rollout_values_,
      rollout_returns_, rollout_factors_;
  std::vector<double> mode_;    // [A]
  std::vector<double> played_;  // [A]
};

}  // namespace dreamsearch
