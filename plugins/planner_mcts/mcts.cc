// mcts.cc - Monte Carlo tree search over sampled actions (Koul et al. 2020): the
// components `mcts_pw` and `mcts_fixed`.
#include "mcts.h"

#include "tree_planner.h"

namespace dreamsearch {
namespace {

struct MctsSettings : TreeSettings {
  double c1, c2;
  double puct_scale;
  bool first_play_zero;
};
constexpr auto kC1Parameter = Bind<&MctsSettings::c1>(
    RealParameter("c1", 1.25, 0, 1e6, "", "c1 of the selection rule (Schrittwieser et al. 2020)."));
constexpr auto kC2Parameter = Bind<&MctsSettings::c2>(RealParameter(
    "c2", 19652, 1e-6, 1e12, "visits", "c2 of the selection rule (Schrittwieser et al. 2020)."));
constexpr auto kPuctScaleParameter = Bind<&MctsSettings::puct_scale>(
    RealParameter("puct_scale", 1, 0, 1e6, "",
                  "Multiplies the exploration term; the paper lists a c_puct of 0.05 and uses it "
                  "in no equation."));
constexpr auto kFirstPlayParameter = Bind<&MctsSettings::first_play_zero>(
    ChoiceParameter("first_play", "parent_mean", "parent_mean,zero",
                    "Normalised Q of an action not yet tried: that of the visit-weighted mean of "
                    "its siblings, or 0."));

struct PwSettings : MctsSettings {
  double widening_constant;
  double widening_exponent;
  SearchTree::Index samples_ahead;
  SearchTree::Index root_actions;
};
constexpr auto kPwSettings = BindSettings<PwSettings>(
    kSimulationsParameter,
    Bind<&PwSettings::widening_constant>(RealParameter(
        "widening_constant", 1, 1e-3, 1e6, "actions",
        "C in the widening rule: a node with n visits and fewer than C n^alpha actions "
        "gets one more (Koul et al. 2020).")),
    Bind<&PwSettings::widening_exponent>(RealParameter(
        "widening_exponent", 0.5, 0, 1, "", "alpha in the widening rule (Koul et al. 2020).")),
    Bind<&PwSettings::samples_ahead>(IntParameter(
        "samples_ahead", 4, 1, 1000, "actions",
        "Actions sampled together when a node widens; those not needed yet wait for its "
        "next widenings. Changes the cost, not the distribution.")),
    Bind<&PwSettings::root_actions>(IntParameter(
        "root_actions", 0, 0, 10000, "actions",
        "Actions of the root, all sampled before the first simulation, where other nodes widen; "
        "0: the root widens too (Koul et al. 2020).")),
    kRootUniformParameter, kC1Parameter, kC2Parameter, kPuctScaleParameter, kFirstPlayParameter,
    kEqualDepthParameter, kEdgeRewardParameter, kNoiseParameter, kLeafBatchParameter,
    kValueBonusParameter, kValueInEvaluationParameter, kReuseParameter);

struct FixedSettings : MctsSettings {
  SearchTree::Index children;
};
constexpr auto kFixedSettings = BindSettings<FixedSettings>(
    kSimulationsParameter,
    Bind<&FixedSettings::children>(
        IntParameter("children", 20, 1, 10000, "actions",
                     "Actions sampled from the actor at each node (Koul et al. 2020).")),
    kRootUniformParameter, kC1Parameter, kC2Parameter, kPuctScaleParameter, kFirstPlayParameter,
    kEqualDepthParameter, kEdgeRewardParameter, kNoiseParameter, kLeafBatchParameter,
    kValueBonusParameter, kValueInEvaluationParameter, kReuseParameter);

// Selection by
//
//     Qbar(a) + P(a) sqrt(n) / (1 + N(a)) (c1 + ln((n + c2 + 1) / c2)),  n = sum_b N(b),
//
// with P uniform over the node's actions and Qbar the min-max normalised Q. A
// simulation in flight counts as a visit whose Qbar was 0. Ties go to the action
// created first.
class Mcts : public TreePlanner {
 protected:
  Mcts(const PlannerContext& context, const MctsSettings& settings, std::uint64_t max_edges)
      : TreePlanner(context, settings, max_edges), first_play_zero_(settings.first_play_zero) {
    exploration_.resize(simulations() + 1);
    for (std::uint64_t i = 0; i <= simulations(); ++i) {
      const double n = static_cast<double>(i);
      exploration_[i] = settings.puct_scale * std::sqrt(n) *
                        (settings.c1 + std::log((n + settings.c2 + 1) / settings.c2));
    }
  }

  // The best child by the rule above; the node has children.
  Index BestChild(Index node) const noexcept {
    const Index visits = tree_.visits(node);
    const double exploration =
        exploration_[visits + tree_.in_flight(node)] / tree_.child_count(node);
    const double q_min = tree_.q_min();
    const double q_scale = tree_.q_scale();
    const double first_play =
        !first_play_zero_ && visits > 0 ? (tree_.mean_q(node) - q_min) * q_scale : 0;
    Index best = SearchTree::kNone;
    double best_score = 0;
    for (Index edge = tree_.first_child(node); edge != SearchTree::kNone;
         edge = tree_.next_sibling(edge)) {
      const double edge_visits = tree_.edge_visits(edge);
      double q = edge_visits > 0 ? (tree_.q(edge) - q_min) * q_scale : first_play;
      double all_visits = edge_visits;
      if (const double in_flight = tree_.edge_in_flight(edge); in_flight > 0) {
        all_visits += in_flight;
        q *= edge_visits / all_visits;
      }
      const double score = q + exploration / (1 + all_visits);
      if (best == SearchTree::kNone || score > best_score) {
        best = edge;
        best_score = score;
      }
    }
    return best;
  }

  // The same, after as many actions have been sampled as the node lacks of `count`.
  Status BestOf(Index count, Index node, Index* edge) noexcept {
    if (const Index children = tree_.child_count(node); children < count) {
      Index first = 0;
      Status status = AddSampledEdges(node, count - children, &first);
      if (!status.ok()) return status;
    }
    *edge = BestChild(node);
    return OkStatus();
  }

  Index ChoosePlayed() noexcept override { return LargestQ(); }

 private:
  const bool first_play_zero_;
  std::vector<double> exploration_;  // by n: sqrt(n) (c1 + ln(...)), scaled
};

// Progressive widening (Couetoux et al. 2011): the number of actions at a node grows
// with its visits. Actions are sampled some ahead, because a sample costs an
// evaluation of the actor at the node's latent, and several cost hardly more.
class MctsPw final : public Mcts {
 public:
  explicit MctsPw(const PlannerContext& context)
      : MctsPw(context, kPwSettings.Read(context.parameters)) {}

 private:
  MctsPw(const PlannerContext& context, const PwSettings& settings)
      : Mcts(context, settings, settings.simulations + settings.root_actions),
        samples_ahead_(settings.samples_ahead),
        root_actions_(settings.root_actions),
        action_size_(context.action_size),
        waiting_((simulations() + 1) * samples_ahead_ * action_size_),
        waiting_count_(simulations() + 1) {
    widen_below_.resize(simulations() + 1);
    for (std::uint64_t n = 0; n <= simulations(); ++n) {
      widen_below_[n] = n == 0 ? 1
                               : settings.widening_constant *
                                     std::pow(static_cast<double>(n), settings.widening_exponent);
    }
  }

  // Samples of the decision before came from other latents.
  Status BeginSearch() noexcept override {
    std::fill(waiting_count_.begin(), waiting_count_.end(), 0u);
    return OkStatus();
  }

  Status ChooseEdge(Index node, Index* edge) noexcept override {
    if (node == SearchTree::kRoot && root_actions_ > 0) return BestOf(root_actions_, node, edge);
    const Index children = tree_.child_count(node);
    if (children == 0 || children < widen_below_[tree_.visits(node) + tree_.in_flight(node)]) {
      return Widen(node, edge);
    }
    *edge = BestChild(node);
    return OkStatus();
  }

  // Adds the first of the node's waiting actions, after sampling more if none waits.
  Status Widen(Index node, Index* edge) noexcept {
    const MatrixView<double> actions{waiting_.data() + node * samples_ahead_ * action_size_,
                                     samples_ahead_, action_size_};
    if (waiting_count_[node] == 0) {
      Status status = SampleActions(node, tree_.edge_count(), actions);
      if (!status.ok()) return status;
      waiting_count_[node] = samples_ahead_;
    }
    *edge = tree_.AddEdges(node, 1);
    std::copy_n(actions.row(samples_ahead_ - waiting_count_[node]).data, action_size_,
                tree_.actions(*edge, 1).data);
    --waiting_count_[node];
    return OkStatus();
  }

  const Index samples_ahead_, root_actions_;
  const std::uint64_t action_size_;
  std::vector<double> widen_below_;   // by n: C n^alpha
  std::vector<double> waiting_;       // [nodes, samples_ahead, A]
  std::vector<Index> waiting_count_;  // by node: of the last of its samples
};

// A fixed number of actions a node, sampled when a simulation first passes through
// it. (Sampling them when the node is expanded draws the same kind of actions for
// leaves that no simulation ever returns to.)
class MctsFixed final : public Mcts {
 public:
  explicit MctsFixed(const PlannerContext& context)
      : MctsFixed(context, kFixedSettings.Read(context.parameters)) {}

 private:
  MctsFixed(const PlannerContext& context, const FixedSettings& settings)
      : Mcts(context, settings, settings.simulations * settings.children),
        children_(settings.children) {}

  Status ChooseEdge(Index node, Index* edge) noexcept override {
    return BestOf(children_, node, edge);
  }

  const Index children_;
};

}  // namespace

constexpr ComponentDescriptor kMctsPw = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "mcts_pw",
    .version = "1.0.0",
    .summary = "Tree search whose nodes gain actions as they gain visits (progressive widening)",
    .parameters = kPwSettings.declared(),
    .metrics = ViewOf(kTreeMetrics),
    .create_planner = CreatePlanner<MctsPw>,
};

constexpr ComponentDescriptor kMctsFixed = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "mcts_fixed",
    .version = "1.0.0",
    .summary = "Tree search with a fixed number of sampled actions at each node",
    .parameters = kFixedSettings.declared(),
    .metrics = ViewOf(kTreeMetrics),
    .create_planner = CreatePlanner<MctsFixed>,
};

}  // namespace dreamsearch
