// agent.h - observe, plan: how a model and a planner choose actions in an episode.
//
// An agent carries the belief (the posterior latent) and the planner's memory
// through one episode. It owns neither the model nor the planner.
//
// Units    actions in [-1, 1]; rewards and values per decision.
// Errors   Failure; 72 when something is not finite, 70 otherwise.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "dreamsearch/environment.h"
#include "dreamsearch/model.h"
#include "dreamsearch/planner.h"
#include "host/acting/activity_clock.h"
#include "host/acting/outputs.h"
#include "host/plugins/model_proxy.h"
#include "host/saving/state.h"
#include "host/settings/seeds.h"
#include "host/settings/settings.h"

namespace dreamsearch {

// What was decided, and what the search did for it.
struct Decision {
  double value = 0;
  double plan_us = 0;  // posterior update and planning, by Agent::Now
  std::uint32_t simulations = 0;
  std::uint32_t nodes = 0;
  std::uint32_t depth = 0;
};

// Throws Failure unless what a planner, `who`, planned keeps the laws of PlanResult.
void CheckPlanned(const std::string& who, std::uint64_t decision, const PlanResult& result);
// Likewise the improved policy that it reported.
void CheckPolicy(const std::string& who, MatrixView<const double> actions,
                 View<const double> weights);

class Agent {
 public:
  struct Parts {
    Model* model = nullptr;
    std::string model_name;
    Planner* planner = nullptr;
    std::string planner_text;            // in messages: "planner 'cem'"
    bool searches = true;                // or Imagine is refused
    std::vector<std::string> metrics;    // names of what the planner reports
    std::size_t policy_actions = 0;      // that are asked of its improved policy
    Environment* environment = nullptr;  // whose state is given to a model that needs one
    bool model_needs_environment = false;
    std::uint64_t run_seed = 0;
    std::uint64_t exploration_hold = 1;  // run.exploration_hold
    // Seconds. For an agent that decides beside others its share of their time.
    std::function<double()> clock = ActivityClock::Now;

    // What of a planner's declaration concerns the agent.
    void SetPlanner(const ResolvedComponent& component);
  };
  explicit Agent(const Parts& parts);

  void BeginEpisode(EpisodePurpose phase, std::uint64_t episode);
  // From the next Decide on.
  void set_run_seed(std::uint64_t seed) { parts_.run_seed = seed; }

  // Goes to where another agent of the same model stands after its Decide, as if that had
  // chosen `action`, [A]. What its planner carries from decision to decision is not taken over.
  void StandBeside(const Agent& other, View<const double> action);

  // Updates the belief with what the last action led to, and chooses the next.
  // observation: [O]; environment_step: steps the run has made.
  Decision Decide(View<const double> observation, bool explore, std::uint64_t environment_step,
                  TreeSink* tree = nullptr);

  // The action of the last Decide, [A]; zero at an episode's start.
  View<const double> action() const { return action_.view(); }
  // The improved policy of the last Decide, as many actions as the parts say.
  MatrixView<const double> policy_actions() const {
    return {policy_actions_.data(), policy_weights_.size(), action_.size()};
  }
  View<const double> policy_weights() const {
    return {policy_weights_.data(), policy_weights_.size()};
  }
  // The planner's metrics of the last Decide.
  const Outputs& metrics() const { return metrics_; }
  double Now() const { return parts_.clock(); }
  // Transitions the planner imagined since the agent was made or restored.
  std::uint64_t transitions() const { return proxy_.transitions(); }

  // Belief, last action and the planner's memory.
  void Save(StateWriter* writer) const;
  void Load(StateReader* reader);

 private:
  std::byte* Latent(std::size_t index);
  const std::byte* Latent(std::size_t index) const {
    return const_cast<Agent*>(this)->Latent(index);
  }
  // Throws Failure unless Plan set what it must and nothing beside it.
  void CheckOutputs() const;

  Parts parts_;
  StateSaving* state_saving_;   // null unless the model needs the environment's state
  TreeReporting* tree_report_;  // of the planner, or null
  PolicyReporting* policy_report_;
  ModelProxy proxy_;
  std::uint64_t latent_bytes_;
  std::vector<std::byte> latent_memory_;  // two aligned latents: current and next
  std::size_t current_ = 0;
  std::vector<std::byte> environment_state_;
  Outputs action_;
  Outputs metrics_;
  Outputs policy_actions_;
  Outputs policy_weights_;
  EpisodePurpose phase_ = EpisodePurpose::kTraining;
  std::uint64_t episode_ = 0;
  std::uint64_t decision_ = 0;
};

}  // namespace dreamsearch
