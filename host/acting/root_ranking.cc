#include "host/acting/root_ranking.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "host/acting/actor.h"
#include "host/acting/episode.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

std::vector<double> Ranks(const std::vector<double>& numbers) {
  std::vector<std::size_t> order(numbers.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return numbers[a] < numbers[b]; });
  std::vector<double> ranks(numbers.size());
  for (std::size_t first = 0, end = 0; first < order.size(); first = end) {
    while (end < order.size() && numbers[order[end]] == numbers[order[first]]) ++end;
    const double shared = static_cast<double>(first + end - 1) / 2;
    for (std::size_t i = first; i < end; ++i) ranks[order[i]] = shared;
  }
  return ranks;
}

Agent::Parts ActorOf(Agent::Parts parts, Planner* actor) {
  parts.planner = actor;
  parts.planner_text = "the actor of model '" + parts.model_name + "'";
  parts.searches = false;
  parts.metrics.clear();
  parts.policy_actions = 0;
  return parts;
}

}  // namespace

double RankCorrelation(const std::vector<double>& a, const std::vector<double>& b) {
  const std::vector<double> x = Ranks(a), y = Ranks(b);
  const double middle = (static_cast<double>(x.size()) - 1) / 2;
  double xx = 0, yy = 0, xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - middle) * (x[i] - middle);
    yy += (y[i] - middle) * (y[i] - middle);
    xy += (x[i] - middle) * (y[i] - middle);
  }
  return xx > 0 && yy > 0 ? xy / std::sqrt(xx * yy) : 0;
}

RootRanker::RootRanker(Agent::Parts agent, const std::string& environment_name,
                       std::uint64_t action_repeat, std::uint64_t decisions)
    : environment_(agent.environment),
      state_saving_(ExtensionOf<StateSaving>(agent.environment)),
      environment_name_(environment_name),
      action_repeat_(action_repeat),
      decisions_(decisions),
      actor_(MakeActor()),
      follower_(ActorOf(std::move(agent), actor_.get())),
      observation_(environment_->spec().observation_size) {
  if (state_saving_ == nullptr) {
    throw Failure(ExitCode::kUsage,
                  "--rank-every: environment '" + environment_name +
                      "' cannot save its state, so that one action alone can be tried in it");
  }
  state_.resize(state_saving_->state_bytes());
}

void RootRanker::Restore() {
  ThrowUnlessOk(state_saving_->RestoreState({state_.data(), state_.size()}),
                "environment '" + environment_name_ + "' RestoreState");
}

double RootRanker::ReturnAfter(const Agent& agent, View<const double> action,
                               std::uint64_t environment_step) {
  const View<double> observation{observation_.data(), observation_.size()};
  Restore();
  follower_.StandBeside(agent, action);
  double sum = 0;
  for (std::uint64_t i = 0; i < decisions_; ++i) {
    if (i > 0) follower_.Decide(observation, false, environment_step);
    const HeldAction held = HoldAction(environment_, environment_name_, follower_.action(),
                                       action_repeat_, observation);
    sum += held.reward;
    if (held.last) break;
  }
  return sum;
}

RootRanking RootRanker::Rank(const Agent& agent, const TreeCollector& tree,
                             std::uint64_t environment_step) {
  std::vector<const TreeCollector::Kept*> root;
  double visits = 0;
  for (const TreeCollector::Kept& edge : tree.edges()) {
    if (edge.parent != -1 || edge.visits == 0) continue;
    root.push_back(&edge);
    visits += static_cast<double>(edge.visits);
  }
  RootRanking ranking;
  if (root.size() < 2) return ranking;
  ranking.first_visits = static_cast<double>(root.front()->visits) / visits;
  ThrowUnlessOk(state_saving_->SaveState({state_.data(), state_.size()}),
                "environment '" + environment_name_ + "' SaveState");
  std::vector<double> promised, found;
  const std::size_t taken = std::min(root.size(), kMostActions);
  for (std::size_t i = 0; i < taken; ++i) {
    const TreeCollector::Kept& edge = *root[i * root.size() / taken];
    promised.push_back(edge.q);
    found.push_back(ReturnAfter(agent, {edge.action.data(), edge.action.size()}, environment_step));
  }
  const double played = ReturnAfter(agent, agent.action(), environment_step);
  Restore();
  const auto [worst, best] = std::minmax_element(found.begin(), found.end());
  const auto [least, most] = std::minmax_element(promised.begin(), promised.end());
  ranking.ordered = *best > *worst && *most > *least;
  ranking.spread = std::max(*best, played) - std::min(*worst, played);
  ranking.regret = std::max(*best, played) - played;
  ranking.correlation = RankCorrelation(promised, found);
  return ranking;
}

}  // namespace dreamsearch
