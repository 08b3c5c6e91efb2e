#include "host/acting/episode.h"

#include <algorithm>
#include <cmath>

#include "host/acting/actor.h"
#include "results/system/digest.h"
#include "results/system/error.h"

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
  for (std::uint64_t i = 0; i < most_steps && !held.last; ++i) {
    StepResult step;
    const Status status = environment->Step({bounded.data(), bounded.size()}, observation, &step);
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
  if (!std::isfinite(held.reward) || !std::isfinite(held.discount) || !AllFinite(observation)) {
    throw Failure(ExitCode::kDiverged,
                  "environment '" + name + "': a reward or an observation is not finite");
  }
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
    agent.environment = (*parts_.environments)[seat].get();
    agent.run_seed = parts_.run_seed;
    agent.clock = [model = parts_.model, seat] { return model->Seconds(seat); };
    agents_.push_back(std::make_unique<Agent>(agent));
  }
}

EpisodePlayers::Parts EpisodePlayers::PartsOf(const RunSpec& spec, const Components& components,
                                              Who who, JointModel* model,
                                              const std::vector<EnvironmentPtr>* environments) {
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
  Environment* environment = (*parts_.environments)[seat].get();
  Agent* agent = agents_[seat].get();
  const std::string& name = parts_.environment_name;
  const auto seed = static_cast<std::uint32_t>(
      SeedFor(parts_.run_seed, SeedUse::kEnvironment, EpisodePurpose::kEvaluation, index, 0));
  std::vector<double> observation(environment->spec().observation_size);
  const View<double> view{observation.data(), observation.size()};
  ThrowUnlessOk(environment->Reset(seed, view), "environment '" + name + "' Reset");
  if (course.arrived) course.arrived(index, 0, environment, nullptr);
  agent->BeginEpisode(EpisodePurpose::kEvaluation, index);
  const double begin = agent->Now();
  const std::uint64_t transitions_before = agent->transitions();
  std::vector<double> plan_us;
  results::EpisodeDigest digest;
  HeldAction held;
  for (std::uint64_t t = 0; !held.last; ++t) {
    if (!course.go_on(index, t)) return false;
    const Decision decision =
        agent->Decide(view, false, env_step, course.tree ? course.tree(index, t) : nullptr);
    if (course.decided) course.decided(index, t, decision, *agent);
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
  row->wall_seconds = agent->Now() - begin;
  row->plan_us_mean = Mean(plan_us);
  row->plan_us_p95 = Percentile95(plan_us);
  row->model_transitions = static_cast<std::int64_t>(agent->transitions() - transitions_before);
  row->digest = digest.state();
  return true;
}

}  // namespace dreamsearch
