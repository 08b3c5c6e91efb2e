// hoot.cc - tree search with hierarchical optimistic optimisation at its nodes,
// `hoot` (Mansley, Weinstein, Littman 2011; HOO is Bubeck, Munos, Stoltz,
// Szepesvari 2011).
//
// Every node of the search tree has a binary tree of cells that covers the action
// box [-1, 1]^A: the whole box at depth 0, and a cell's two halves, cut across
// component (depth mod A), below it. A simulation at a node walks from the whole box
// to a cell without halves, always into the half with the larger
//
//     B(cell) = min(U(cell), max of B over its halves),
//     U(cell) = Qbar + c sqrt(2 ln n / N) + nu rho^depth,    rho = 2^(-alpha / A),
//
// where Qbar is the mean return of the simulations through the cell's actions, min-max
// normalised over the search tree (HOO asks for rewards in [0, 1]), N their number, n
// that of all at the node. B of a cell without actions is infinite; without halves
// B = U. Ties go to the lower half.
//
// HOO plays a new action every time. A latent met once is never met again, so no tree
// would grow deeper than one transition. Therefore (ours) a cell keeps the one action
// drawn uniformly in it, and is halved when split_visits * (depth + 1) simulations
// went through that action; the half that holds the action takes it over. That the
// price of a half grows with depth lets the mean of a good action settle: with a
// constant price of 4 the deceptive bandit of the tests is lost 5 times in 100.
//
// Actions are spread over the box and not proposed by the actor, so exploring adds
// noise to the played action only.
#include <limits>

#include "mcts.h"
#include "tree_planner.h"

namespace dreamsearch {
namespace {

struct HootSettings : TreeSettings {
  SearchTree::Index split_visits;
  double exploration;
  double nu;
  double alpha;
};
constexpr auto kSettings = BindSettings<HootSettings>(
    kSimulationsParameter,
    Bind<&HootSettings::split_visits>(
        IntParameter("split_visits", 1, 1, 1000000, "visits",
                     "A cell at depth h is halved after this times h + 1 simulations through its "
                     "action.")),
    Bind<&HootSettings::exploration>(
        RealParameter("exploration", 1, 0, 1e6, "", "c in U; 1 is HOO's (Bubeck et al. 2011).")),
    Bind<&HootSettings::nu>(
        RealParameter("nu", 1, 0, 1e6, "",
                      "nu in U: how much the normalised return may vary over the whole box.")),
    Bind<&HootSettings::alpha>(RealParameter(
        "alpha", 1, 1e-3, 10, "",
        "Smoothness: returns of actions at distance d differ by about d^alpha (Bubeck et "
        "al. 2011, example 1).")),
    kEqualDepthParameter, kEdgeRewardParameter,
    Bind<&HootSettings::noise_std>(RealParameter(
        "noise_std", 0.3, 0, 10, "",
        "Standard deviation of the Gaussian noise on the played action while exploring "
        "(Koul et al. 2020).")),
    kLeafBatchParameter, kValueBonusParameter, kValueInEvaluationParameter);

class Hoot final : public TreePlanner {
 public:
  explicit Hoot(const PlannerContext& context)
      : Hoot(context, kSettings.Read(context.parameters)) {}

 private:
  Hoot(const PlannerContext& context, const HootSettings& settings)
      : TreePlanner(context, settings, settings.simulations),
        split_visits_(settings.split_visits),
        exploration_(settings.exploration),
        nu_(settings.nu),
        rho_(std::exp2(-settings.alpha / static_cast<double>(context.action_size))),
        // Halving a component more often than a double has digits tells nothing apart.
        max_depth_(std::min<std::uint64_t>(50 * context.action_size, 1000)),
        cells_(3 * simulations() + 1),
        node_cell_(simulations() + 1),
        low_(context.action_size),
        high_(context.action_size) {}

  struct Cell {
    Index halves;  // the lower half, the upper one follows it; kNone while whole
    Index edge;    // of a whole cell: its action; kNone while it has none
    double b;      // of the walk under way
  };
  // What is known of the actions of a cell.
  struct CellStatistics {
    double visits = 0;     // with simulations in flight
    double completed = 0;  // without them
    double sum = 0;        // of returns
  };

  Status BeginSearch() noexcept override {
    cell_count_ = 0;
    nodes_with_cells_ = 0;
    return OkStatus();
  }

  Status ChooseEdge(Index node, Index* edge) noexcept override {
    // Nodes arrive in the order of their indices, but not all are ever walked through.
    for (; nodes_with_cells_ <= node; ++nodes_with_cells_) {
      node_cell_[nodes_with_cells_] = SearchTree::kNone;
    }
    if (node_cell_[node] == SearchTree::kNone) node_cell_[node] = NewCell(SearchTree::kNone);
    const double n = tree_.visits(node) + tree_.in_flight(node);
    log_n_ = n > 1 ? std::log(n) : 0;
    Rate(node_cell_[node], 0);

    std::fill(low_.begin(), low_.end(), -1.0);
    std::fill(high_.begin(), high_.end(), 1.0);
    Index cell = node_cell_[node];
    std::uint64_t depth = 0;
    while (cells_[cell].halves != SearchTree::kNone) {
      const Index lower = cells_[cell].halves;
      const bool upper = cells_[lower + 1].b > cells_[lower].b;
      Narrow(depth++, upper);
      cell = lower + (upper ? 1 : 0);
    }
    const Index played = cells_[cell].edge;
    if (played != SearchTree::kNone) {
      const Index visits = tree_.edge_visits(played) + tree_.edge_in_flight(played);
      if (visits < split_visits_ * (depth + 1) || depth >= max_depth_) {
        *edge = played;
        return OkStatus();
      }
      const std::uint64_t component = depth % low_.size();
      const bool played_is_upper = tree_.actions(played, 1)(0, component) >= Middle(component);
      const Index lower = NewCell(played_is_upper ? SearchTree::kNone : played);
      NewCell(played_is_upper ? played : SearchTree::kNone);
      cells_[cell].halves = lower;
      cells_[cell].edge = SearchTree::kNone;
      Narrow(depth, !played_is_upper);
      cell = played_is_upper ? lower : lower + 1;
    }
    *edge = tree_.AddEdges(node, 1);
    cells_[cell].edge = *edge;
    Random random(DeriveSeed(SearchSeed(), *edge));
    const View<double> action = tree_.actions(*edge, 1).row(0);
    for (std::uint64_t j = 0; j < action.size; ++j) action[j] = random.Uniform(low_[j], high_[j]);
    return OkStatus();
  }

  Index ChoosePlayed() noexcept override { return LargestQ(); }

  Index NewCell(Index edge) noexcept {
    cells_[cell_count_] = {SearchTree::kNone, edge, 0};
    return cell_count_++;
  }

  double Middle(std::uint64_t component) const noexcept {
    return 0.5 * (low_[component] + high_[component]);
  }
  void Narrow(std::uint64_t depth, bool upper) noexcept {
    const std::uint64_t component = depth % low_.size();
    (upper ? low_ : high_)[component] = Middle(component);
  }

  // Sets B of a cell and of all below it.
  CellStatistics Rate(Index cell, std::uint64_t depth) noexcept {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    CellStatistics statistics;
    double below = kInfinity;
    if (const Index lower = cells_[cell].halves; lower != SearchTree::kNone) {
      const CellStatistics first = Rate(lower, depth + 1);
      const CellStatistics second = Rate(lower + 1, depth + 1);
      statistics = {first.visits + second.visits, first.completed + second.completed,
                    first.sum + second.sum};
      below = std::max(cells_[lower].b, cells_[lower + 1].b);
    } else if (const Index edge = cells_[cell].edge; edge != SearchTree::kNone) {
      statistics.completed = tree_.edge_visits(edge);
      statistics.visits = statistics.completed + tree_.edge_in_flight(edge);
      statistics.sum = statistics.completed * tree_.q(edge);
    }
    if (statistics.visits == 0) {
      cells_[cell].b = kInfinity;
      return statistics;
    }
    double q = 0;
    if (statistics.completed > 0) {
      // Simulations in flight count as returns at the lower extreme.
      q = (statistics.sum / statistics.completed - tree_.q_min()) * tree_.q_scale() *
          statistics.completed / statistics.visits;
    }
    const double u = q + exploration_ * std::sqrt(2 * log_n_ / statistics.visits) +
                     nu_ * std::pow(rho_, static_cast<double>(depth));
    cells_[cell].b = std::min(u, below);
    return statistics;
  }

  const Index split_visits_;
  const double exploration_;
  const double nu_;
  const double rho_;
  const std::uint64_t max_depth_;
  std::vector<Cell> cells_;       // of all nodes
  std::vector<Index> node_cell_;  // by node: its whole box, kNone before the first walk
  std::vector<double> low_;       // [A]: of the cell the walk is in
  std::vector<double> high_;      // [A]
  Index cell_count_ = 0;
  Index nodes_with_cells_ = 0;  // entries of node_cell_ in use
  double log_n_ = 0;
};

}  // namespace

constexpr ComponentDescriptor kHoot = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "hoot",
    .version = "1.0.0",
    .summary = "Tree search with hierarchical optimistic optimisation over the actions of a node",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kTreeMetrics),
    .create_planner = CreatePlanner<Hoot>,
};

}  // namespace dreamsearch
