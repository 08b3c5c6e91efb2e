#include "tree_planner.h"

#include <algorithm>
#include <cassert>

namespace dreamsearch {
namespace {

// Streams of a decision's seed.
enum Stream : std::uint64_t {
  kProposal = 1,
  kCandidateNoise = 2,
  kImagine = 3,
  kPlayedNoise = 4,
  kSearch = 5,
  kRollout = 6,
  kRootUniform = 7
};

}  // namespace

TreePlanner::TreePlanner(const PlannerContext& context, const TreeSettings& settings,
                         std::uint64_t max_edges)
    : tree_(settings.simulations + 1, max_edges, context.action_size, context.latent_bytes),
      sizes_{context.action_size, context.latent_bytes, kTreeMetricCount},
      settings_(settings),
      values_(settings, settings.leaf_batch) {
  if (settings_.leaf_batch > 1) {
    batch_latents_ = LatentBuffer(settings_.leaf_batch, sizes_.latent_bytes);
    batch_actions_.resize(settings_.leaf_batch * sizes_.action_size);
  }
  if (settings_.equal_depth > 0) {
    for (LatentBuffer& latents : rollout_latents_) {
      latents = LatentBuffer(settings_.leaf_batch, sizes_.latent_bytes);
    }
    rollout_order_.resize(settings_.leaf_batch);
    rollout_actions_.resize(settings_.leaf_batch * sizes_.action_size);
    for (auto* numbers : {&rollout_rewards_, &rollout_discounts_, &rollout_values_,
                          &rollout_returns_, &rollout_factors_}) {
      numbers->resize(settings_.leaf_batch);
    }
  }
  seeds_.resize(settings_.leaf_batch);
  mode_.resize(sizes_.action_size);
  played_.resize(sizes_.action_size);
}

Status TreePlanner::BeginEpisode(LatentModel* model) noexcept {
  if (Status status = CheckModel(sizes_, model); !status.ok()) return status;
  model_ = model;
  tree_.Clear();
  decided_ = false;
  return OkStatus();
}

void TreePlanner::KeepOfLastDecision() noexcept {
  if (!decided_) return;
  decided_ = false;
  if (kept_edge_ != SearchTree::kNone) {
    tree_.KeepSubtree(tree_.child(kept_edge_));
  } else {
    tree_.Clear();
  }
}

Status TreePlanner::Plan(const PlanRequest& request, PlanResult* result) noexcept {
  if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
  KeepOfLastDecision();
  explore_ = request.explore;
  seed_ = request.seed;
  if (tree_.empty()) {
    tree_.Reset(request.root);
  } else {
    tree_.SetRootLatent(request.root);
  }
  const Index old_nodes = tree_.node_count();
  const std::uint64_t budget = settings_.simulations - tree_.visits(SearchTree::kRoot);
  const View<double> mode{mode_.data(), mode_.size()};
  const View<double> played{played_.data(), played_.size()};
  Status status = model_->ProposeMode(request.root, {mode.data, 1, mode.size});
  if (status.ok()) status = CheckFinite("action component", mode);
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
    AddExplorationNoise(settings_.noise_std, DeriveSeed(seed_, kPlayedNoise),
                        {played.data, 1, played.size});
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
  decided_ = true;
  kept_edge_ = settings_.reuse_tree && !(request.explore && settings_.noise_std > 0)
                   ? chosen
                   : SearchTree::kNone;
  return OkStatus();
}

Status TreePlanner::ReportPolicy(MatrixView<double> policy, View<double> weights) noexcept {
  return FillPolicy(
      sizes_,
      [this](auto visit) {
        Index i = 0;
        for (Index edge = tree_.first_child(SearchTree::kRoot); edge != SearchTree::kNone;
             edge = tree_.next_sibling(edge)) {
          visit(PolicyWeight(i++, edge), tree_.actions(edge, 1).row(0));
        }
      },
      policy, weights);
}

Status TreePlanner::Search(std::uint64_t budget) noexcept {
  while (budget > 0) {
    const std::uint64_t wanted = std::min(settings_.leaf_batch, budget);
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
      tree_.BackUp(leaf, settings_.edge_reward);
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
  if (status.ok()) {
    status = settings_.equal_depth > 0 ? RollOut(first, count) : AskValues(first, count);
  }
  if (status.ok()) status = CheckFinite("reward", tree_.rewards(first, count));
  if (status.ok()) status = CheckFinite("discount", tree_.discounts(first, count));
  if (status.ok()) tree_.MarkEvaluated();
  return status;
}

Status TreePlanner::RollOut(Index first, Index count) noexcept {
  const auto left = [&](Index leaf) {
    const Index depth = tree_.depth(first + leaf);
    return depth < settings_.equal_depth ? settings_.equal_depth - depth : 0;
  };
  for (Index i = 0; i < count; ++i) rollout_order_[i] = i;
  std::sort(rollout_order_.begin(), rollout_order_.begin() + count,
            [&](Index a, Index b) { return left(a) != left(b) ? left(a) > left(b) : a < b; });
  for (Index row = 0; row < count; ++row) {
    rollout_latents_[0].Set(row, tree_.latents(first + rollout_order_[row], 1));
    rollout_returns_[row] = 0;
    rollout_factors_[row] = 1;
  }
  const auto under_way = [&](Index step) {  // rows that have a step-th transition
    Index rows = 0;
    while (rows < count && left(rollout_order_[rows]) >= step) ++rows;
    return rows;
  };
  for (Index step = 1, rows = count;; ++step) {
    const LatentBuffer& here = rollout_latents_[(step - 1) % 2];
    const Index next = under_way(step);
    // Rows that have arrived are valued.
    if (rows > next) {
      const Index arrived = rows - next;
      const View<double> values{rollout_values_.data() + next, arrived};
      Status status = values_.Ask(model_, {here.row(next).data, arrived, sizes_.latent_bytes},
                                  explore_, values);
      if (status.ok()) status = CheckFinite("value", values);
      if (!status.ok()) return status;
      for (Index row = next; row < rows; ++row) {
        tree_.values(first + rollout_order_[row], 1)[0] =
            rollout_returns_[row] + rollout_factors_[row] * rollout_values_[row];
      }
    }
    if (next == 0) return OkStatus();
    const ConstLatents from{here.row(0).data, next, sizes_.latent_bytes};
    const MatrixView<double> actions{rollout_actions_.data(), next, sizes_.action_size};
    Status status = model_->ProposeMode(from, actions);
    if (status.ok()) status = CheckFinite("action component", {actions.data, actions.size()});
    for (Index row = 0; row < next; ++row) {
      seeds_[row] =
          DeriveSeed(DeriveSeed(DeriveSeed(seed_, kRollout), first + rollout_order_[row]), step);
    }
    const View<double> rewards{rollout_rewards_.data(), next};
    const View<double> discounts{rollout_discounts_.data(), next};
    if (status.ok()) {
      status =
          model_->Imagine({.latents = from,
                           .actions = {actions.data, next, sizes_.action_size},
                           .seeds = {seeds_.data(), next}},
                          {rollout_latents_[step % 2].middle_rows(0, next), rewards, discounts});
    }
    if (status.ok()) status = CheckFinite("reward", rewards);
    if (status.ok()) status = CheckFinite("discount", discounts);
    if (!status.ok()) return status;
    for (Index row = 0; row < next; ++row) {
      rollout_returns_[row] += rollout_factors_[row] * rewards[row];
      rollout_factors_[row] *= discounts[row];
    }
    rows = next;
  }
}

Status TreePlanner::AskValues(Index first, Index count) noexcept {
  const View<double> values = tree_.values(first, count);
  const Status status = values_.Ask(model_, tree_.latents(first, count), explore_, values);
  return status.ok() ? CheckFinite("value", values) : status;
}

Status TreePlanner::AddSampledEdges(Index node, Index count, Index* first) noexcept {
  *first = tree_.AddEdges(node, count);
  return SampleActions(node, *first, tree_.actions(*first, count));
}

Status TreePlanner::SampleActions(Index node, std::uint64_t stream,
                                  MatrixView<double> actions) noexcept {
  const std::uint64_t seed = DeriveSeed(DeriveSeed(seed_, kProposal), stream);
  Status status = model_->ProposeSamples(tree_.latents(node, 1), {&seed, 1}, actions);
  if (status.ok()) status = CheckFinite("action component", {actions.data, actions.size()});
  if (status.ok() && explore_) {
    AddExplorationNoise(settings_.noise_std, DeriveSeed(DeriveSeed(seed_, kCandidateNoise), stream),
                        actions);
  }
  if (status.ok() && node == SearchTree::kRoot && settings_.root_uniform > 0) {
    Random random(DeriveSeed(DeriveSeed(seed_, kRootUniform), stream));
    for (std::uint64_t i = 0; i < actions.rows; ++i) {
      if (random.Uniform(0, 1) >= settings_.root_uniform) continue;
      for (double& component : actions.row(i)) component = random.Uniform(-1, 1);
    }
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

Status TreePlanner::Save(ByteSink* sink) const noexcept {
  const_cast<TreePlanner*>(this)->KeepOfLastDecision();  // what will have been kept anyway
  return tree_.Save(sink);
}

Status TreePlanner::Load(ByteSource* source) noexcept {
  decided_ = false;
  if (Status status = tree_.Load(source); !status.ok()) return status;
  if (!settings_.reuse_tree && !tree_.empty()) {
    tree_.Clear();
    return Error(StatusCode::kDataLoss, "a kept tree was saved, but reuse_tree is off");
  }
  return OkStatus();
}

}  // namespace dreamsearch
