#include "host/acting/episode.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "host/acting/actor.h"
#include "host/acting/outputs.h"
#include "host/plugins/call_site.h"
#include "results/system/digest.h"
#include "results/system/error.h"
#include "results/text/text.h"

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

namespace {

// Entry i of the observation by its part: "entry 2 of 'velocity'".
std::string PartOf(const EnvironmentSpec& spec, std::uint64_t i) {
  std::uint64_t first = 0;
  for (const ObservationPart& part : spec.observation) {
    if (i < first + part.size) {
      return "entry " + std::to_string(i - first) + " of '" + part.name + "'";
    }
    first += part.size;
  }
  return "entry " + std::to_string(i);
}

}  // namespace

void CheckReturn(const EnvironmentSpec& spec, const std::string& name, double episode_return) {
  const double slack =
      1e-6 * std::max({1.0, std::abs(spec.return_low), std::abs(spec.return_high)});
  const bool inside =
      episode_return >= spec.return_low - slack && episode_return <= spec.return_high + slack;
  if (inside || spec.return_low == spec.return_high) return;
  throw Failure(ExitCode::kPluginRefused,
                "environment '" + name + "' says that returns lie in [" +
                    ExactText(spec.return_low) + ", " + ExactText(spec.return_high) +
                    "], by which scores are normalised; an episode's was " +
                    ExactText(episode_return));
}

void ResetEnvironment(Environment* environment, const std::string& name, std::uint32_t seed,
                      View<double> observation) {
  const CallScope scope({"environment", name.c_str(), "Reset"});
  ThrowUnlessOk(environment->Reset(seed, observation), "environment '" + name + "' Reset");
}

HeldAction HoldAction(Environment* environment, const std::string& name, View<const double> action,
                      std::uint64_t most_steps, View<double> observation) {
  std::vector<double> bounded(action.size);
  ToEnvironmentBounds(environment->spec(), action, {bounded.data(), bounded.size()});
  Outputs seen(observation.size);
  HeldAction held;
  const std::string who = "environment '" + name + "'";
  for (std::uint64_t i = 0; i < most_steps && !held.last; ++i) {
    StepResult step;
    seen.Unset();
    step.reward = std::numeric_limits<double>::quiet_NaN();
    const CallScope scope({"environment", name.c_str(), "Step"});
    const Status status = environment->Step({bounded.data(), bounded.size()}, seen.view(), &step);
    if (status.code == StatusCode::kDiverged) {
      held.diverged = "environment '" + name + "': " + status.message;
      held.last = true;
      return held;
    }
    ThrowUnlessOk(status, "environment '" + name + "' Step");
    ++held.steps;
    held.reward += step.reward;
    held.discount = step.discount;
    held.last = step.last;
  }
  if (!seen.intact()) {
    throw Failure(ExitCode::kInternal, who + " wrote beside its observation (" +
                                           std::to_string(seen.size()) + " numbers)");
  }
  if (!std::isfinite(held.reward)) {
    throw Failure(ExitCode::kDiverged, who + ": a reward was not set, or is not finite");
  }
  for (std::uint64_t i = 0; i < seen.size(); ++i) {
    if (std::isfinite(seen[i])) continue;
    throw Failure(ExitCode::kDiverged, who + ": an observation was not set, or is not finite: " +
                                           PartOf(environment->spec(), i));
  }
  if (held.discount != 0 && held.discount != 1) {
    throw Failure(ExitCode::kPluginRefused, who + " gave a discount of " +
                                                ExactText(held.discount) +
                                                ", expected 0 at a terminal state and 1 elsewhere");
  }
  std::copy(seen.begin(), seen.end(), observation.begin());
  return held;
}

void CheckLength(const Environment& environment, const std::string& name, std::uint64_t length) {
  const std::uint64_t limit = environment.spec().episode_steps;
  if (length < limit) return;
  throw Failure(ExitCode::kPluginRefused,
                "environment '" + name + "' says episode_steps = " + std::to_string(limit) +
                    ", expected `last` at that step at the latest, found an episode that goes "
                    "on after " +
                    std::to_string(length));
}

EpisodePlayers::EpisodePlayers(Parts parts) : parts_(std::move(parts)) {
  for (std::size_t seat = 0; seat < parts_.model->seats(); ++seat) {
    Agent::Parts agent = parts_.agent;
    agent.model = parts_.model->seat(seat);
    agent.planner = parts_.planners[seat].get();
    agent.environment = parts_.environments[seat].get();
    agent.run_seed = parts_.run_seed;
    agent.clock = [model = parts_.model, seat] { return model->Seconds(seat); };
    agents_.push_back(std::make_unique<Agent>(agent));
    if (parts_.ranks.every == 0) continue;
    rankers_.push_back(std::make_unique<RootRanker>(agent, parts_.environment_name,
                                                    parts_.action_repeat, parts_.ranks.decisions));
  }
}

EpisodePlayers::Parts EpisodePlayers::PartsOf(const RunSpec& spec, const Components& components,
                                              Who who, JointModel* model,
                                              std::span<const EnvironmentPtr> environments) {
  Parts parts;
  parts.model = model;
  parts.environments = environments;
  parts.environment_name = spec.environment.name();
  parts.action_repeat = spec.action_repeat();
  parts.run_seed = spec.seed;
  parts.agent.model_name = spec.model.name();
  parts.agent.model_needs_environment = spec.model.Has(kNeedsEnvironment);
  if (who == Who::kActor) {
    parts.agent.planner_text = "the actor of model '" + spec.model.name() + "'";
    parts.agent.searches = false;
    for (std::size_t i = 0; i < model->seats(); ++i) parts.planners.push_back(MakeActor());
    return parts;
  }
  const bool evaluation = who == Who::kEvaluationPlanner;
  const ResolvedComponent& planner = evaluation ? spec.eval_planner : spec.planner;
  parts.agent.SetPlanner(planner);
  if (spec.evaluation) parts.ranks = spec.evaluation->ranks;
  for (std::size_t i = 0; i < model->seats(); ++i) {
    parts.planners.push_back(evaluation ? components.MakeEvaluationPlanner(*model->seat(i))
                                        : components.MakePlanner(*model->seat(i)));
  }
  return parts;
}

void EpisodePlayers::Play(const EpisodeCourse& course, std::uint64_t env_step) {
  parts_.model->Run([&](std::size_t seat) {
    while (const std::optional<std::uint64_t> index = course.next()) {
      try {
        results::EpisodeRow row;
        if (!PlayOne(seat, *index, course, env_step, &row)) return;
        course.ended(*index, row);
      } catch (...) {
        return course.failed(*index, std::current_exception());
      }
    }
  });
}

bool EpisodePlayers::PlayOne(std::size_t seat, std::uint64_t index, const EpisodeCourse& course,
                             std::uint64_t env_step, results::EpisodeRow* row) {
  Environment* environment = parts_.environments[seat].get();
  Agent* agent = agents_[seat].get();
  const std::string& name = parts_.environment_name;
  const auto seed = static_cast<std::uint32_t>(
      SeedFor(parts_.run_seed, SeedUse::kEnvironment, EpisodePurpose::kEvaluation, index, 0));
  std::vector<double> observation(environment->spec().observation_size);
  const View<double> view{observation.data(), observation.size()};
  ResetEnvironment(environment, name, seed, view);
  if (course.arrived) course.arrived(index, 0, environment, nullptr);
  agent->BeginEpisode(EpisodePurpose::kEvaluation, index);
  const double begin = agent->Now();
  const std::uint64_t transitions_before = agent->transitions();
  std::vector<double> plan_us;
  results::EpisodeDigest digest;
  HeldAction held;
  for (std::uint64_t t = 0; !held.last; ++t) {
    if (!course.go_on(index, t)) return false;
    const bool rank = course.ranked && !rankers_.empty() && t % parts_.ranks.every == 0;
    TreeCollector tree;
    TreeSink* sink = rank ? &tree : course.tree ? course.tree(index, t) : nullptr;
    const Decision decision = agent->Decide(view, false, env_step, sink);
    if (course.decided) course.decided(index, t, decision, *agent);
    if (rank) course.ranked(index, t, rankers_[seat]->Rank(*agent, tree, env_step));
    held = HoldAction(environment, name, agent->action(), parts_.action_repeat, view);
    if (course.arrived) course.arrived(index, t + 1, environment, &held);
    if (!held.diverged.empty()) {
      if (course.diverged) course.diverged(index, t, held.diverged);
      break;
    }
    row->length += static_cast<std::int64_t>(held.steps);
    row->episode_return += held.reward;
    digest.AddDecision(agent->action().data, agent->action().size, held.reward, decision.value);
    plan_us.push_back(decision.plan_us);
    if (!held.last) CheckLength(*environment, name, static_cast<std::uint64_t>(row->length));
  }
  if (held.diverged.empty()) CheckReturn(environment->spec(), name, row->episode_return);
  row->wall_seconds = agent->Now() - begin;
  row->plan_us_mean = Mean(plan_us);
  row->plan_us_p95 = Percentile95(plan_us);
  row->model_transitions = static_cast<std::int64_t>(agent->transitions() - transitions_before);
  row->digest = digest.state();
  return true;
}

}  // namespace dreamsearch
