#include "host/acting/agent.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "host/acting/components.h"
#include "host/plugins/call_site.h"
#include "results/system/error.h"

namespace dreamsearch {

void Agent::Parts::SetPlanner(const ResolvedComponent& component) {
  planner_text = "planner '" + component.name() + "'";
  searches = component.Has(kSearches);
  for (const MetricInfo& metric : component.info->metrics) metrics.push_back(metric.name);
}

void CheckPlanned(const std::string& who, std::uint64_t decision, const PlanResult& result) {
  for (std::uint64_t i = 0; i < result.action.size; ++i) {
    const double entry = result.action[i];
    if (!std::isfinite(entry)) {
      throw Failure(ExitCode::kDiverged,
                    who + " chose an action that is not finite, or not set: entry " +
                        std::to_string(i) + " of decision " + std::to_string(decision));
    }
    if (std::abs(entry) > 1) {
      throw Failure(ExitCode::kInternal, who + " chose an action outside [-1, 1]: entry " +
                                             std::to_string(i) + " is " + std::to_string(entry));
    }
  }
  if (!std::isfinite(result.value)) {
    throw Failure(
        ExitCode::kDiverged,
        who + " set no value, or one that is not finite, in decision " + std::to_string(decision));
  }
}

void CheckPolicy(const std::string& who, MatrixView<const double> actions,
                 View<const double> weights) {
  double sum = 0;
  for (std::uint64_t k = 0; k < weights.size; ++k) {
    const View<const double> action = actions.row(k);
    const double weight = weights[k];
    sum += weight;
    if (weight >= 0 && std::all_of(action.begin(), action.end(),
                                   [](double entry) { return std::abs(entry) <= 1; })) {
      continue;
    }
    throw Failure(ExitCode::kInternal, who + " reported a policy whose action " +
                                           std::to_string(k) + " lies outside [-1, 1] or weighs " +
                                           std::to_string(weight));
  }
  if (!(std::abs(sum - 1) < 1e-6)) {
    throw Failure(ExitCode::kInternal, who + " reported a policy whose weights sum to " +
                                           std::to_string(sum) + ", expected 1");
  }
}

Agent::Agent(const Parts& parts)
    : parts_(parts),
      state_saving_(parts.model_needs_environment ? ExtensionOf<StateSaving>(parts.environment)
                                                  : nullptr),
      tree_report_(ExtensionOf<TreeReporting>(parts.planner)),
      policy_report_(ExtensionOf<PolicyReporting>(parts.planner)),
      proxy_(parts.model, parts.model_name, parts.searches),
      latent_bytes_(parts.model->latent_bytes()),
      latent_memory_(2 * latent_bytes_ + kLatentAlignment),
      action_(parts.model->action_size()),
      metrics_(parts.metrics.size()),
      policy_actions_(parts.policy_actions * action_.size()),
      policy_weights_(parts.policy_actions) {
  if (state_saving_ != nullptr) environment_state_.resize(state_saving_->state_bytes());
}

std::byte* Agent::Latent(std::size_t index) {
  void* memory = latent_memory_.data();
  std::size_t space = latent_memory_.size();
  auto* aligned =
      static_cast<std::byte*>(std::align(kLatentAlignment, 2 * latent_bytes_, memory, space));
  return aligned + index * latent_bytes_;
}

void Agent::BeginEpisode(EpisodePurpose phase, std::uint64_t episode) {
  phase_ = phase;
  episode_ = episode;
  decision_ = 0;
  action_.Fill(0);
  {
    const CallScope scope({"model", parts_.model_name.c_str(), "InitialLatent"});
    ThrowUnlessOk(parts_.model->InitialLatent({Latent(current_), 1, latent_bytes_}),
                  "model '" + parts_.model_name + "' InitialLatent");
  }
  const CallScope scope({"", parts_.planner_text.c_str(), "BeginEpisode"});
  ThrowUnlessOk(parts_.planner->BeginEpisode(&proxy_), parts_.planner_text + " BeginEpisode");
}

void Agent::StandBeside(const Agent& other, View<const double> action) {
  BeginEpisode(other.phase_, other.episode_);
  decision_ = other.decision_;
  std::copy(action.begin(), action.end(), action_.data());
  std::copy_n(other.Latent(other.current_), latent_bytes_, Latent(current_));
}

Decision Agent::Decide(View<const double> observation, bool explore, std::uint64_t environment_step,
                       TreeSink* tree) {
  const double begin = Now();
  ObserveRequest observe;
  observe.previous = {Latent(current_), 1, latent_bytes_};
  observe.actions = {action_.data(), 1, action_.size()};
  observe.observations = {observation.data, 1, observation.size};
  if (state_saving_ != nullptr) {
    ThrowUnlessOk(state_saving_->SaveState({environment_state_.data(), environment_state_.size()}),
                  "environment SaveState");
    observe.environment_states = {environment_state_.data(), 1, environment_state_.size()};
  }
  const std::uint64_t observe_seed =
      SeedFor(parts_.run_seed, SeedUse::kObserve, phase_, episode_, decision_);
  observe.seeds = {&observe_seed, 1};
  {
    const CallScope scope({"model", parts_.model_name.c_str(), "Observe", "decision", decision_});
    ThrowUnlessOk(parts_.model->Observe(observe, {Latent(1 - current_), 1, latent_bytes_}),
                  "model '" + parts_.model_name + "' Observe");
  }
  current_ = 1 - current_;

  const std::string& who = parts_.planner_text;
  PlanRequest request;
  request.root = {Latent(current_), 1, latent_bytes_};
  request.explore = explore;
  const std::uint64_t drawn = HeldDecision(parts_.run_seed, phase_, episode_, decision_,
                                           explore ? parts_.exploration_hold : 1);
  request.seed = SeedFor(parts_.run_seed, SeedUse::kPlan, phase_, episode_, drawn);
  request.decision = decision_;
  request.environment_step = environment_step;
  PlanResult result;
  for (Outputs* outputs : {&action_, &metrics_, &policy_actions_, &policy_weights_}) {
    outputs->Unset();
  }
  result.action = action_.view();
  result.metrics = metrics_.view();
  result.value = std::numeric_limits<double>::quiet_NaN();
  const CallScope scope({"", who.c_str(), "Plan", "decision", decision_});
  const Status status = parts_.planner->Plan(request, &result);
  ThrowUnlessOk(proxy_.fault(), who + " Plan");
  ThrowUnlessOk(status, who + " Plan");
  Decision decision;
  decision.value = result.value;
  decision.simulations = result.simulations;
  decision.nodes = result.nodes;
  decision.depth = result.depth;
  CheckOutputs();
  CheckPlanned(who, decision_, result);
  if (tree != nullptr && tree_report_ != nullptr) tree_report_->ReportTree(tree);
  if (policy_weights_.size() > 0) {
    const MatrixView<double> policy{policy_actions_.data(), policy_weights_.size(), action_.size()};
    ThrowUnlessOk(policy_report_->ReportPolicy(policy, policy_weights_.view()),
                  who + " ReportPolicy");
    CheckOutputs();
    CheckPolicy(who, policy, policy_weights_.view());
  }
  ++decision_;
  decision.plan_us = (Now() - begin) * 1e6;
  return decision;
}

void Agent::CheckOutputs() const {
  const std::string& who = parts_.planner_text;
  const std::pair<const Outputs*, const char*> all[] = {{&action_, "the action"},
                                                        {&metrics_, "its metrics"},
                                                        {&policy_actions_, "the policy's actions"},
                                                        {&policy_weights_, "the policy's weights"}};
  for (const auto& [outputs, what] : all) {
    if (outputs->intact()) continue;
    throw Failure(ExitCode::kInternal, who + " wrote beside " + what + " (" +
                                           std::to_string(outputs->size()) +
                                           " numbers) in decision " + std::to_string(decision_));
  }
  for (std::size_t i = 0; i < metrics_.size(); ++i) {
    if (std::isfinite(metrics_[i])) continue;
    throw Failure(ExitCode::kDiverged, who + " did not set its metric '" + parts_.metrics[i] +
                                           "', or not to a finite number, in decision " +
                                           std::to_string(decision_));
  }
}

void Agent::Save(StateWriter* writer) const {
  (*writer)("agent_phase", &phase_);
  (*writer)("agent_episode", &episode_);
  (*writer)("agent_decision", &decision_);
  writer->Array("agent_action", action_.data(), action_.size());
  const std::uint64_t transitions = proxy_.transitions();
  (*writer)("agent_transitions", &transitions);
  writer->Array("agent_latent", Latent(current_), latent_bytes_);
  const CallScope scope({"", parts_.planner_text.c_str(), "Save"});
  ThrowUnlessOk(
      writer->Stream("planner_memory", [&](ByteSink* sink) { return parts_.planner->Save(sink); }),
      parts_.planner_text + " Save");
}

void Agent::Load(StateReader* reader) {
  EpisodePurpose phase{};
  std::uint64_t episode = 0, transitions = 0;
  (*reader)("agent_phase", &phase);
  (*reader)("agent_episode", &episode);
  BeginEpisode(phase, episode);
  (*reader)("agent_decision", &decision_);
  reader->Array("agent_action", action_.data(), action_.size());
  (*reader)("agent_transitions", &transitions);
  proxy_.set_transitions(transitions);
  reader->Array("agent_latent", Latent(current_), latent_bytes_);
  const CallScope scope({"", parts_.planner_text.c_str(), "Load"});
  ThrowUnlessOk(reader->Stream("planner_memory",
                               [&](ByteSource* source) { return parts_.planner->Load(source); }),
                parts_.planner_text + " Load");
}

}  // namespace dreamsearch
