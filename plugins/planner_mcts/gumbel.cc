// gumbel.cc - tree search that halves its root actions, `mcts_gumbel` (Danihelka,
// Guez, Schrittwieser, Silver 2022, "Policy improvement by planning with Gumbel").
//
// The paper draws m of finitely many root actions without replacement by their
// Gumbel-perturbed log-probabilities. Over a continuous action space that is a
// Gumbel process (Maddison, Tarlow, Minka 2014): its m largest points lie at m
// independent samples of the actor, and the i-th largest perturbed log-probability
// is g_i = -ln(E_1 + ... + E_i) with standard exponential E. Without exploration
// every g is 0.
//
// Root      Sequential halving (Karnin, Koren, Somekh 2013): the simulations are
//           spent in ceil(log2 m) phases; a phase visits all remaining actions
//           equally often and leaves the better half, by g + sigma(q). The action
//           with the largest g + sigma(q) of those visited most is played.
// Elsewhere The action with the largest pi'(a) - N(a) / (1 + sum_b N(b)), where
//           pi' = softmax(sigma(q)) over the node's sampled actions: they are drawn
//           from the actor, so their log-probabilities are equal.
// sigma(q)  (c_visit + max_b N(b)) * c_scale * Qbar, with Q min-max normalised over
//           the tree. An unvisited action has the paper's mixed value (appendix D),
//           (v + n * mean Q of the visited actions) / (1 + n).
// Policy    The improved policy that is reported is the root's pi'.
#include "mcts.h"
#include "tree_planner.h"

namespace dreamsearch {
namespace {

struct GumbelSettings : TreeSettings {
  std::uint64_t root_actions;
  SearchTree::Index children;
  double c_visit;
  double c_scale;
  double gumbel_scale;
};
constexpr auto kSettings = BindSettings<GumbelSettings>(
    kSimulationsParameter,
    Bind<&GumbelSettings::root_actions>(IntParameter(
        "root_actions", 16, 1, 10000, "actions",
        "Actions sampled at the root; at most one a simulation is used (Danihelka et al. "
        "2022).")),
    Bind<&GumbelSettings::children>(
        IntParameter("children", 16, 1, 10000, "actions", "Actions sampled at every other node.")),
    Bind<&GumbelSettings::c_visit>(RealParameter("c_visit", 50, 0, 1e6, "visits",
                                                 "c_visit of sigma (Danihelka et al. 2022).")),
    Bind<&GumbelSettings::c_scale>(
        RealParameter("c_scale", 0.1, 0, 1e6, "",
                      "c_scale of sigma (0.1 in DeepMind's library, 1 in the paper's Go).")),
    Bind<&GumbelSettings::gumbel_scale>(RealParameter(
        "gumbel_scale", 1, 0, 1e6, "",
        "Multiplies the root's Gumbel noise while exploring (Danihelka et al. 2022).")),
    kEqualDepthParameter, kEdgeRewardParameter, kNoiseParameter, kLeafBatchParameter,
    kValueBonusParameter, kValueInEvaluationParameter);

class Gumbel final : public TreePlanner {
 public:
  explicit Gumbel(const PlannerContext& context)
      : Gumbel(context, kSettings.Read(context.parameters)) {}

 private:
  Gumbel(const PlannerContext& context, const GumbelSettings& settings)
      : TreePlanner(context, settings,
                    RootActions(settings) + settings.simulations * settings.children),
        root_actions_(static_cast<Index>(RootActions(settings))),
        children_(settings.children),
        c_visit_(settings.c_visit),
        c_scale_(settings.c_scale),
        gumbel_scale_(settings.gumbel_scale),
        gumbel_(root_actions_),
        scores_(std::max(root_actions_, children_)) {
    PlanVisits();
  }

  static std::uint64_t RootActions(const GumbelSettings& settings) {
    return std::min(settings.root_actions, settings.simulations);
  }

  // turn_[k] is the number of visits that the root action of simulation k has had:
  // in a phase with c actions left each is visited max(1, n / (phases * c)) times.
  void PlanVisits() {
    std::uint64_t phases = 0;
    while ((std::uint64_t{1} << phases) < root_actions_) ++phases;
    phases = std::max<std::uint64_t>(phases, 1);
    Index visits = 0;
    for (std::uint64_t left = root_actions_; turn_.size() < simulations();
         left = std::max<std::uint64_t>(1, left / 2)) {
      const std::uint64_t each = std::max<std::uint64_t>(1, simulations() / (phases * left));
      for (std::uint64_t i = 0; i < each; ++i, ++visits) {
        turn_.insert(turn_.end(), left, visits);
      }
    }
  }

  Status BeginSearch() noexcept override {
    if (Status status = AskValues(SearchTree::kRoot, 1); !status.ok()) return status;
    Random random(SearchSeed());
    double sum = 0;
    for (double& g : gumbel_) {
      sum -= std::log(1 - random.Uniform());
      g = exploring() ? -gumbel_scale_ * std::log(sum) : 0;
    }
    Index first = 0;
    return AddSampledEdges(SearchTree::kRoot, root_actions_, &first);
  }

  Status ChooseEdge(Index node, Index* edge) noexcept override {
    if (node == SearchTree::kRoot) {
      const Index begun = tree_.visits(node) + tree_.in_flight(node);
      *edge = BestOfVisited(turn_[begun]);
      return OkStatus();
    }
    if (tree_.child_count(node) == 0) {
      Index first = 0;
      if (Status status = AddSampledEdges(node, children_, &first); !status.ok()) return status;
    }
    *edge = MatchImprovedPolicy(node);
    return OkStatus();
  }

  Index ChoosePlayed() noexcept override {
    Index most = 0;
    for (Index edge = tree_.first_child(SearchTree::kRoot); edge != SearchTree::kNone;
         edge = tree_.next_sibling(edge)) {
      most = std::max(most, tree_.edge_visits(edge));
    }
    const Index best = BestOfVisited(most);
    ExponentiateScores(tree_.child_count(SearchTree::kRoot));
    return best;
  }

  double PolicyWeight(Index i, Index) const noexcept override { return scores_[i]; }

  Index AllVisits(Index edge) const noexcept {
    return tree_.edge_visits(edge) + tree_.edge_in_flight(edge);
  }

  // The root action with the largest g + sigma(q) of those with so many visits.
  Index BestOfVisited(Index visits) noexcept {
    Sigma(SearchTree::kRoot);
    Index best = SearchTree::kNone;
    double best_score = 0;
    Index i = 0;
    for (Index edge = tree_.first_child(SearchTree::kRoot); edge != SearchTree::kNone;
         edge = tree_.next_sibling(edge), ++i) {
      if (AllVisits(edge) != visits) continue;
      const double score = gumbel_[i] + scores_[i];
      if (best == SearchTree::kNone || score > best_score) {
        best = edge;
        best_score = score;
      }
    }
    return best;
  }

  Index MatchImprovedPolicy(Index node) noexcept {
    Sigma(node);
    const double sum = ExponentiateScores(tree_.child_count(node));
    const double all_visits = tree_.visits(node) + tree_.in_flight(node);
    Index best = SearchTree::kNone;
    double best_score = 0;
    Index i = 0;
    for (Index edge = tree_.first_child(node); edge != SearchTree::kNone;
         edge = tree_.next_sibling(edge), ++i) {
      const double score = scores_[i] / sum - AllVisits(edge) / (1 + all_visits);
      if (best == SearchTree::kNone || score > best_score) {
        best = edge;
        best_score = score;
      }
    }
    return best;
  }

  // The first `count` scores become pi' but for its sum, which is returned.
  double ExponentiateScores(Index count) noexcept {
    double largest = scores_[0], sum = 0;
    for (Index i = 1; i < count; ++i) largest = std::max(largest, scores_[i]);
    for (Index i = 0; i < count; ++i) {
      scores_[i] = std::exp(scores_[i] - largest);
      sum += scores_[i];
    }
    return sum;
  }

  // scores_[i] = sigma(q) of the node's i-th child. A simulation in flight counts as
  // a visit whose normalised Q was 0.
  void Sigma(Index node) noexcept {
    double sum = 0, visited = 0, most = 0;
    for (Index edge = tree_.first_child(node); edge != SearchTree::kNone;
         edge = tree_.next_sibling(edge)) {
      if (tree_.edge_visits(edge) == 0) continue;
      sum += tree_.q(edge);
      visited += 1;
      most = std::max<double>(most, tree_.edge_visits(edge));
    }
    // Nothing is known to tell the children apart.
    if (visited == 0) {
      std::fill_n(scores_.begin(), tree_.child_count(node), 0.0);
      return;
    }
    const double n = tree_.visits(node);
    const double mixed = (tree_.value(node) + n * (sum / visited)) / (1 + n);
    const double scale = (c_visit_ + most) * c_scale_;
    Index i = 0;
    for (Index edge = tree_.first_child(node); edge != SearchTree::kNone;
         edge = tree_.next_sibling(edge), ++i) {
      const double visits = tree_.edge_visits(edge);
      double q = ((visits > 0 ? tree_.q(edge) : mixed) - tree_.q_min()) * tree_.q_scale();
      if (tree_.edge_in_flight(edge) > 0) q *= visits / (visits + tree_.edge_in_flight(edge));
      scores_[i] = scale * q;
    }
  }

  const Index root_actions_;
  const Index children_;
  const double c_visit_;
  const double c_scale_;
  const double gumbel_scale_;
  std::vector<Index> turn_;     // by simulation
  std::vector<double> gumbel_;  // [root_actions]
  std::vector<double> scores_;  // scratch, by child
};

}  // namespace

constexpr ComponentDescriptor kMctsGumbel = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "mcts_gumbel",
    .version = "1.0.0",
    .summary = "Tree search with Gumbel root selection and sequential halving over sampled actions",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kTreeMetrics),
    .create_planner = CreatePlanner<Gumbel>,
};

}  // namespace dreamsearch
