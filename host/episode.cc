#include "episode.h"

#include <algorithm>
#include <cmath>

#include "activity_clock.h"
#include "components.h"
#include "error.h"
#include "results/digest.h"

namespace dreamsearch {

bool AllFinite(View<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

double Percentile95(std::vector<double> values) {
  if (values.empty()) return 0;
  const std::size_t index = (values.size() - 1) * 95 / 100;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(index),
                   values.end());
  return values[index];
}

HeldAction HoldAction(Environment* environment, const std::string& name, View<const double> action,
                      std::uint64_t most_steps, View<double> observation) {
  std::vector<double> bounded(action.size);
  ToEnvironmentBounds(environment->spec(), action, {bounded.data(), bounded.size()});
  HeldAction held;
  StepResult step;
  for (std::uint64_t i = 0; i < most_steps && !step.last; ++i) {
    ThrowUnlessOk(environment->Step({bounded.data(), bounded.size()}, observation, &step),
                  "environment '" + name + "' Step");
    ++held.steps;
    held.reward += step.reward;
  }
  held.discount = step.discount;
  held.last = step.last;
  if (!std::isfinite(held.reward) || !std::isfinite(held.discount) || !AllFinite(observation)) {
    throw RunnerError(ExitCode::kDiverged,
                      "environment '" + name + "': a reward or an observation is not finite");
  }
  return held;
}

void CheckLength(const Environment& environment, const std::string& name, std::uint64_t length) {
  const std::uint64_t limit = environment.spec().episode_steps;
  if (length < limit) return;
  throw RunnerError(ExitCode::kPluginRefused,
                    "environment '" + name + "' says episode_steps = " + std::to_string(limit) +
                        ", expected `last` at that step at the latest, found an episode that goes "
                        "on after " +
                        std::to_string(length));
}

bool PlayEvaluationEpisode(const EvaluationEpisode& episode, const EpisodeHooks& hooks,
                           results::EpisodeRow* row) {
  const auto seed = static_cast<std::uint32_t>(
      SeedFor(episode.run_seed, SeedUse::kEnvironment, Phase::kEvaluation, episode.index, 0));
  std::vector<double> observation(episode.environment->spec().observation_size);
  const View<double> view{observation.data(), observation.size()};
  ThrowUnlessOk(episode.environment->Reset(seed, view),
                "environment '" + episode.environment_name + "' Reset");
  Agent* agent = episode.agent;
  agent->BeginEpisode(Phase::kEvaluation, episode.index);
  const double begin = ActivityClock::Now();
  const std::uint64_t transitions_before = agent->transitions();
  std::vector<double> plan_us;
  results::EpisodeDigest digest;
  HeldAction held;
  for (std::uint64_t t = 0; !held.last; ++t) {
    if (!hooks.go_on(t)) return false;
    const Decision decision =
        agent->Decide(view, false, episode.env_step, hooks.tree ? hooks.tree(t) : nullptr);
    if (hooks.decided) hooks.decided(t, decision);
    held = HoldAction(episode.environment, episode.environment_name, agent->action(),
                      episode.action_repeat, view);
    row->length += static_cast<std::int64_t>(held.steps);
    row->episode_return += held.reward;
    digest.AddDecision(agent->action().data, agent->action().size, held.reward, decision.value);
    plan_us.push_back(decision.plan_us);
    if (!held.last) {
      CheckLength(*episode.environment, episode.environment_name,
                  static_cast<std::uint64_t>(row->length));
    }
  }
  row->wall_seconds = ActivityClock::Now() - begin;
  row->plan_us_mean = Mean(plan_us);
  row->plan_us_p95 = Percentile95(plan_us);
  row->model_transitions = static_cast<std::int64_t>(agent->transitions() - transitions_before);
  row->digest = digest.state();
  return true;
}

}  // namespace dreamsearch
