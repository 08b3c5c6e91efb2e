// root_ranking.h - does a search rank the actions at its root as the simulator does?
//
// Every action that the search tried at the root is played in the simulator, the actor alone goes
// on from there, and the returns of the next decisions are compared with what the search promised
// (Q). All of them meet the same draws: those that the episode itself would go on with.
//
// Errors   Failure: 2 if the environment cannot save its state, otherwise as agent.h and
//          episode.h say.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "dreamsearch/environment.h"
#include "host/acting/agent.h"
#include "host/acting/components.h"
#include "host/acting/decision_tree.h"

namespace dreamsearch {

struct RootRanking {
  // Whether there was an order to find: at least two actions whose returns differ, and whose Q do.
  bool ordered = false;
  double correlation = 0;   // Spearman's, of Q and returns
  double first_visits = 0;  // share of the root's visits that its first action has
  // Of the actions that were taken, the played one among them.
  double regret = 0;  // the best return less the played action's
  double spread = 0;  // the best return less the worst
};

// Spearman's rank correlation of as many numbers; equal ones share the mean of their ranks. 0 if
// all of one kind are equal.
double RankCorrelation(const std::vector<double>& a, const std::vector<double>& b);

class RootRanker {
 public:
  // Of a root with more actions it takes these many, evenly spread over their order.
  static constexpr std::size_t kMostActions = 16;

  // `agent`: whose decisions are looked at. `decisions`: the return is that of so many, the root's
  // action among them, fewer where the episode ends. The environment is the agent's own; it is in
  // its state again when Rank returns.
  RootRanker(Agent::Parts agent, const std::string& environment_name, std::uint64_t action_repeat,
             std::uint64_t decisions);

  // After the agent's Decide, which reported `tree`, and before its action is played.
  RootRanking Rank(const Agent& agent, const TreeCollector& tree, std::uint64_t environment_step);

 private:
  // The environment to where the decision was made.
  void Restore();
  double ReturnAfter(const Agent& agent, View<const double> action, std::uint64_t environment_step);

  Environment* const environment_;
  StateSaving* const state_saving_;
  const std::string environment_name_;
  const std::uint64_t action_repeat_, decisions_;
  const PlannerPtr actor_;
  Agent follower_;
  std::vector<std::byte> state_;
  std::vector<double> observation_;
};

}  // namespace dreamsearch
