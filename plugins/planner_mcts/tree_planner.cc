#include "tree_planner.h"

#include <cassert>

namespace dreamsearch {
namespace {

// Streams of a decision's seed.
enum Stream : std::uint64_t {
  kProposal = 1,
  kCandidateNoise = 2,
  kImagine = 3,
  kPlayedNoise = 4,
  kSearch = 5
};

}  // namespace

TreePlanner::TreePlanner(const PlannerContext& context, std::uint64_t max_edges)
    : tree_(static_cast<std::uint64_t>(context.parameters.GetInt("simulations")) + 1, max_edges,
            context.action_size, context.latent_bytes),
      sizes_{context.action_size, context.latent_bytes, kTreeMetricCount},
      simulations_(static_cast<std::uint64_t>(context.parameters.GetInt("simulations"))),
      leaf_batch_(static_cast<std::uint64_t>(context.parameters.GetInt("leaf_batch"))),
      noise_std_(context.parameters.GetReal("noise_std")),
      reuse_tree_(context.parameters.GetBool("reuse_tree")),
      edge_reward_(context.parameters.GetBool("edge_reward")),
      values_(context, leaf_batch_) {
  if (leaf_batch_ > 1) {
    batch_latents_ = LatentBuffer(leaf_batch_, sizes_.latent_bytes);
    batch_actions_.resize(leaf_batch_ * sizes_.action_size);
  }
  seeds_.resize(leaf_batch_);
  mode_.resize(sizes_.action_size);
  played_.resize(sizes_.action_size);
}

Status TreePlanner::BeginEpisode(LatentModel* model) noexcept {
  if (Status status = CheckModel(sizes_, model); !status.ok()) return status;
  model_ = model;
  tree_.Clear();
  return OkStatus();
}

Status TreePlanner::Plan(const PlanRequest& request, PlanResult* result) noexcept {
  if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
  explore_ = request.explore;
  seed_ = request.seed;
  if (tree_.empty()) {
    tree_.Reset(request.root);
  } else {
    tree_.SetRootLatent(request.root);
  }
  const Index old_nodes = tree_.node_count();
  const std::uint64_t budget = simulations_ - tree_.visits(SearchTree::kRoot);
  const View<double> mode{mode_.data(), mode_.size()};
  const View<double> played{played_.data(), played_.size()};
  Status status = model_->ProposeMode(request.root, {mode.data, 1, mode.size});
  if (status.ok()) status = CheckFinite("an action component", mode);
  if (status.ok()) status = BeginSearch();
  if (status.ok()) status = Search(budget);
  if (!status.ok()) {
    tree_.Clear();
    return status;
  }

  const Index chosen = ChoosePlayed();
  assert(tree_.edge_visits(chosen) > 0);
  std::copy_n(tree_.actions(chosen, 1).data, played.size, played.data);
  if (request.explore) {
    AddExplorationNoise(noise_std_, DeriveSeed(seed_, kPlayedNoise), {played.data, 1, played.size});
  }
  Index depth = 0;
  double added_depth = 0;
  for (Index node = 1; node < tree_.node_count(); ++node) {
    depth = std::max(depth, tree_.depth(node));
    if (node >= old_nodes) added_depth += tree_.depth(node);
  }

  std::copy_n(played.data, played.size, result->action.data);
  result->metrics[kRootVisitEntropy] = RootVisitEntropy();
  result->metrics[kModeDistance] = ActionDistance(played, mode);
  result->metrics[kRootChildren] = tree_.child_count(SearchTree::kRoot);
  result->metrics[kMeanLeafDepth] = added_depth / (tree_.node_count() - old_nodes);
  result->metrics[kQGain] = tree_.q(chosen) - tree_.mean_q(SearchTree::kRoot);
  result->value = tree_.q(chosen);
  result->simulations = static_cast<std::uint32_t>(budget);
  result->nodes = tree_.node_count();
  result->depth = depth;
  if (request.tree != nullptr) tree_.Report(request.tree);
  ReportPolicy(
      [this](auto visit) {
        Index i = 0;
        for (Index edge = tree_.first_child(SearchTree::kRoot); edge != SearchTree::kNone;
             edge = tree_.next_sibling(edge)) {
          visit(PolicyWeight(i++, edge), tree_.actions(edge, 1).row(0));
        }
      },
      result);

  if (reuse_tree_ && !(request.explore && noise_std_ > 0)) {
    tree_.KeepSubtree(tree_.child(chosen));
  } else {
    tree_.Clear();
  }
  return OkStatus();
}

Status TreePlanner::Search(std::uint64_t budget) noexcept {
  while (budget > 0) {
    const std::uint64_t wanted = std::min(leaf_batch_, budget);
    const Index first = tree_.node_count();
    while (tree_.node_count() - first < wanted) {
      Index leaf = 0;
      bool collided = false;
      if (Status status = SelectLeaf(&leaf, &collided); !status.ok()) return status;
      if (collided) break;
      if (wanted > 1) tree_.AddInFlight(leaf, 1);
    }
    const Index end = tree_.node_count();
    if (Status status = EvaluatePending(); !status.ok()) return status;
    for (Index leaf = first; leaf < end; ++leaf) {
      if (wanted > 1) tree_.AddInFlight(leaf, -1);
      tree_.BackUp(leaf, edge_reward_);
      EndSimulation(leaf);
    }
    budget -= end - first;
  }
  return OkStatus();
}

// Walks to an unexpanded edge and hangs a pending node on it. A walk that meets a
// node already pending has collided: what lies beyond is not known yet. The first
// walk of a batch cannot.
Status TreePlanner::SelectLeaf(Index* leaf, bool* collided) noexcept {
  Index node = SearchTree::kRoot;
  for (;;) {
    Index edge = 0;
    if (Status status = ChooseEdge(node, &edge); !status.ok()) return status;
    const Index child = tree_.child(edge);
    if (child == SearchTree::kNone) {
      *leaf = tree_.NewNode(edge);
      return OkStatus();
    }
    if (tree_.pending(child)) {
      *collided = true;
      return OkStatus();
    }
    node = child;
  }
}

Status TreePlanner::EvaluatePending() noexcept {
  const Index first = tree_.evaluated_count();
  const Index count = tree_.node_count() - first;
  ImagineRequest request;
  // A node's draws do not depend on who is imagined beside it.
  for (Index i = 0; i < count; ++i) {
    seeds_[i] = DeriveSeed(DeriveSeed(seed_, kImagine), first + i);
  }
  request.seeds = {seeds_.data(), count};
  if (count == 1) {
    const Index edge = tree_.parent_edge(first);
    request.latents = tree_.latents(tree_.parent(edge), 1);
    request.actions = tree_.actions(edge, 1);
  } else {
    for (Index i = 0; i < count; ++i) {
      const Index edge = tree_.parent_edge(first + i);
      batch_latents_.Set(i, tree_.latents(tree_.parent(edge), 1));
      std::copy_n(tree_.actions(edge, 1).data, sizes_.action_size,
                  batch_actions_.data() + i * sizes_.action_size);
    }
    request.latents = batch_latents_.middle_rows(0, count);
    request.actions = {batch_actions_.data(), count, sizes_.action_size};
  }
  const Latents latents = tree_.latents(first, count);
  Status status = model_->Imagine(
      request, {latents, tree_.rewards(first, count), tree_.discounts(first, count)});
  if (status.ok()) status = AskValues(first, count);
  if (status.ok()) status = CheckFinite("a reward", tree_.rewards(first, count));
  if (status.ok()) status = CheckFinite("a discount", tree_.discounts(first, count));
  if (status.ok()) tree_.MarkEvaluated();
  return status;
}

Status TreePlanner::AskValues(Index first, Index count) noexcept {
  const View<double> values = tree_.values(first, count);
  const Status status = values_.Ask(model_, tree_.latents(first, count), explore_, values);
  return status.ok() ? CheckFinite("a value", values) : status;
}

Status TreePlanner::AddSampledEdges(Index node, Index count, Index* first) noexcept {
  *first = tree_.AddEdges(node, count);
  return SampleActions(node, *first, tree_.actions(*first, count));
}

Status TreePlanner::SampleActions(Index node, std::uint64_t stream,
                                  MatrixView<double> actions) noexcept {
  const std::uint64_t seed = DeriveSeed(DeriveSeed(seed_, kProposal), stream);
  Status status = model_->ProposeSamples(tree_.latents(node, 1), {&seed, 1}, actions);
  if (status.ok()) status = CheckFinite("an action component", {actions.data, actions.size()});
  if (status.ok() && explore_) {
    AddExplorationNoise(noise_std_, DeriveSeed(DeriveSeed(seed_, kCandidateNoise), stream),
                        actions);
  }
  return status;
}

TreePlanner::Index TreePlanner::LargestQ() const noexcept {
  Index best = SearchTree::kNone;
  for (Index edge = tree_.first_child(SearchTree::kRoot); edge != SearchTree::kNone;
       edge = tree_.next_sibling(edge)) {
    if (tree_.edge_visits(edge) == 0) continue;
    if (best == SearchTree::kNone || tree_.q(edge) > tree_.q(best)) best = edge;
  }
  return best;
}

std::uint64_t TreePlanner::SearchSeed() const noexcept { return DeriveSeed(seed_, kSearch); }

double TreePlanner::RootVisitEntropy() const noexcept {
  double entropy = 0;
  for (Index edge = tree_.first_child(SearchTree::kRoot); edge != SearchTree::kNone;
       edge = tree_.next_sibling(edge)) {
    if (tree_.edge_visits(edge) == 0) continue;
    const double share = static_cast<double>(tree_.edge_visits(edge)) /
                         static_cast<double>(tree_.visits(SearchTree::kRoot));
    entropy -= share * std::log(share);
  }
  return entropy;
}

Status TreePlanner::Save(ByteSink* sink) const noexcept { return tree_.Save(sink); }

Status TreePlanner::Load(ByteSource* source) noexcept {
  if (Status status = tree_.Load(source); !status.ok()) return status;
  if (!reuse_tree_ && !tree_.empty()) {
    tree_.Clear();
    return Error(StatusCode::kDataLoss, "a kept tree was saved, but reuse_tree is off");
  }
  return OkStatus();
}

}  // namespace dreamsearch
