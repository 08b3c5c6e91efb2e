#include "host/sweeps/probe.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <system_error>

#include "host/acting/activity_clock.h"
#include "host/acting/agent.h"
#include "host/acting/components.h"
#include "host/acting/episode.h"
#include "host/acting/joint_model.h"
#include "host/processes/child_request.h"
#include "host/settings/memory.h"
#include "host/settings/schedule.h"
#include "host/training/reanalysis.h"
#include "host/training/replay.h"
#include "results/system/error.h"
#include "results/system/file_descriptor.h"
#include "results/text/json_fields.h"

namespace dreamsearch {
namespace {

// Repeats `piece` for about `seconds` and at least twice, the first time uncounted;
// returns seconds each.
template <typename Piece>
double SecondsOf(double seconds, Piece piece) {
  piece();
  const double begin = ActivityClock::Now();
  double elapsed = 0;
  int count = 0;
  do {
    piece();
    ++count;
    elapsed = ActivityClock::Now() - begin;
  } while (elapsed < seconds);
  return elapsed / count;
}

// Does each piece of a run, with all that the run keeps beside it; *memory_bytes is what that took.
// Unless the costs are to be measured, each piece is done as often as its memory needs it.
RunCosts Rehearse(const RunSpec& spec, const Components& components, Environment* environment,
                  bool measured, double* memory_bytes) {
  const double patience = measured ? 1 : 0;
  RunCosts costs;
  const EnvironmentSpec& figures = environment->spec();
  std::vector<double> observation(figures.observation_size);
  const View<double> observed{observation.data(), observation.size()};
  std::vector<double> action(figures.action_size), bounded(figures.action_size);
  const View<double> chosen{action.data(), action.size()};
  Random random(SeedFor(spec.seed, SeedUse::kRandomAction, EpisodePurpose::kEvaluation, 0, 0));
  std::uint32_t episode = 0;
  StepResult step;
  step.last = true;
  const auto act = [&] {
    if (step.last) {
      ResetEnvironment(environment, spec.environment.name(), episode++, observed);
      step.last = false;
    }
    for (double& entry : action) entry = random.Uniform(-1, 1);
    ToEnvironmentBounds(figures, chosen, {bounded.data(), bounded.size()});
    ThrowUnlessOk(environment->Step({bounded.data(), bounded.size()}, observed, &step),
                  "environment Step");
  };
  costs.environment_step = SecondsOf(0.1 * patience, act);

  const EnvironmentPtr model_environment =
      spec.model.Has(kNeedsEnvironment) ? components.MakeEnvironment() : nullptr;
  const ModelPtr trained_model = components.MakeTrainedModel(figures, 1);
  const ModelPtr model =
      components.MakeModel(figures, 1, model_environment.get(), trained_model.get());
  const PlannerPtr planner = components.MakePlanner(*model);
  Agent::Parts parts;
  parts.model = model.get();
  parts.model_name = spec.model.name();
  parts.planner = planner.get();
  parts.SetPlanner(spec.planner);
  parts.environment = environment;
  parts.model_needs_environment = spec.model.Has(kNeedsEnvironment);
  parts.policy_actions = spec.search_candidates();
  Agent explorer(parts);
  explorer.BeginEpisode(EpisodePurpose::kTraining, 0);
  costs.training_decision = SecondsOf(0.3 * patience, [&] { explorer.Decide(observed, true, 0); });

  // Evaluations decide for several episodes side by side; here for as many of them as can
  // be done in moments (SecondsOf makes at least three pieces).
  const double moments = measured ? 20 : 2;
  const double affordable = std::max(1.0, moments / (3 * costs.training_decision));
  const double wanted = std::min(static_cast<double>(EpisodePlayers::kMost),
                                 static_cast<double>(spec.run.Integer("eval_episodes")));
  const auto together = static_cast<std::size_t>(std::min(affordable, wanted));
  const auto before_players = static_cast<double>(ResidentBytes(::getpid()));
  std::vector<EnvironmentPtr> environments;
  while (environments.size() < together) {
    environments.push_back(components.MakeEnvironment());
    ResetEnvironment(environments.back().get(), spec.environment.name(), 0, observed);
  }
  JointModel joint(model.get(), together);
  std::vector<EpisodePlayers::Parts> all_players;  // kept, as a run keeps them
  std::vector<std::unique_ptr<Agent>> all_agents;
  const auto evaluation_decision = [&](EpisodePlayers::Who who) {
    const EpisodePlayers::Parts& players = all_players.emplace_back(
        EpisodePlayers::PartsOf(spec, components, who, &joint, environments));
    std::vector<Agent*> agents;
    for (std::size_t i = 0; i < joint.seats(); ++i) {
      Agent::Parts player = players.agent;
      player.model = joint.seat(i);
      player.planner = players.planners[i].get();
      player.environment = environments[i].get();
      agents.push_back(all_agents.emplace_back(std::make_unique<Agent>(player)).get());
      agents.back()->BeginEpisode(EpisodePurpose::kEvaluation, i);
    }
    EpisodeFaults faults;
    const double seconds = SecondsOf(0.3 * patience, [&] {
      joint.Run([&](std::size_t i) {
        try {
          agents[i]->Decide(observed, false, 0);
        } catch (...) {
          faults.Add(i, std::current_exception());
        }
      });
      faults.RethrowFirst();
    });
    return seconds / static_cast<double>(agents.size());
  };
  const double planned = evaluation_decision(
      spec.evaluation ? EpisodePlayers::Who::kPlanner : EpisodePlayers::Who::kEvaluationPlanner);
  if (spec.evaluation) {
    costs.search_evaluation_decision = planned;
  } else if (spec.eval_planner.Has(kActorAlone)) {
    costs.actor_evaluation_decision = planned;
  } else {
    costs.search_evaluation_decision = planned;
    costs.actor_evaluation_decision = evaluation_decision(EpisodePlayers::Who::kActor);
  }
  const double a_player =
      std::max(0.0, static_cast<double>(ResidentBytes(::getpid())) - before_players) /
      static_cast<double>(together);
  const auto memory = [&] {
    return static_cast<double>(PeakResidentBytes()) +
           (wanted - static_cast<double>(together)) * a_player;
  };
  *memory_bytes = memory();
  if (spec.evaluation) return costs;

  const std::uint64_t length = spec.run.Integer("sequence_length");
  Replay replay(figures.observation_size, figures.action_size, 2 * length + 2,
                spec.search_candidates());
  replay.BeginEpisode(observed);
  for (std::uint64_t i = 0; i < 2 * length; ++i) {
    act();
    replay.Add(chosen, step.reward, step.discount, observed);
  }
  replay.EndEpisode();
  costs.replay_row_bytes =
      static_cast<double>(StateBytes([&](StateWriter* writer) { replay.Save(writer); })) /
      static_cast<double>(replay.rows());
  std::vector<double> metrics(components.model().metrics.size);
  std::uint64_t update = 0;
  std::unique_ptr<Reanalysis> reanalysis;
  if (spec.run.Number("reanalyse") > 0) {
    reanalysis = std::make_unique<Reanalysis>(spec, components, model.get());
  }
  if (spec.model.Has(kLearns)) {
    costs.update = SecondsOf(0.5 * patience, [&] {
      const SequenceBatch batch = replay.Sample(spec.run.Integer("batch_size"), length, update);
      if (reanalysis != nullptr) reanalysis->Renew(batch, update, 0, &replay);
      TrainRequest request;
      request.batch = &batch;
      request.seed = update;
      request.update = update++;
      ThrowUnlessOk(model->Train(request, {metrics.data(), metrics.size()}),
                    "model '" + spec.model.name() + "' Train");
    });
  }
  costs.model_save = SecondsOf(0.05 * patience, [&] {
    costs.checkpoint_bytes = static_cast<double>(StateBytes([&](StateWriter* writer) {
      ThrowUnlessOk(writer->Stream("state", [&](ByteSink* sink) { return model->Save(sink); }),
                    "model '" + spec.model.name() + "' Save");
    }));
  });
  *memory_bytes = memory();
  return costs;
}

struct ProbeRequest {
  RunSpec spec;
  ProbeDepth depth = ProbeDepth::kTask;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("spec", &spec);
    (*archive)("depth", &depth);
  }
};

// Of a worker's connection.
constexpr double kDatabaseCacheBytes = 16 << 20;

constexpr double kMostTrialBytes = 32 << 20;

// In memory, as Replay holds it.
double ReplayRowBytes(const RunSpec& spec, const results::TaskInfo& task) {
  const auto actions = static_cast<double>(task.action_size);
  const auto candidates = static_cast<double>(spec.search_candidates());
  const double search = candidates > 0 ? candidates * (actions + 1) + 1 : 0;
  return sizeof(float) * (static_cast<double>(task.observation_size) + actions + 2 + search) + 1;
}

// As the run will make them.
void MakeComponents(const RunSpec& spec, const Components& components,
                    const EnvironmentSpec& figures) {
  const EnvironmentPtr model_environment =
      spec.model.Has(kNeedsEnvironment) ? components.MakeEnvironment() : nullptr;
  const ModelPtr trained_model = components.MakeTrainedModel(figures, 1);
  const ModelPtr model =
      components.MakeModel(figures, 1, model_environment.get(), trained_model.get());
  components.MakePlanner(*model);
  components.MakeEvaluationPlanner(*model);
}

}  // namespace

int ProbeMain() {
  return AnswerMain([](const nlohmann::json& json) {
    const auto asked = results::FieldsFromJson<ProbeRequest>(json);
    const RunSpec& spec = asked.spec;
    const Components components(spec);
    const EnvironmentPtr environment = components.MakeEnvironment();
    const EnvironmentSpec& figures = environment->spec();
    ProbeResult result;
    result.task.name = spec.environment.task();
    result.task.domain = spec.environment.info->plugin.name;
    result.task.observation_size = static_cast<std::int64_t>(figures.observation_size);
    result.task.action_size = static_cast<std::int64_t>(figures.action_size);
    result.task.control_seconds = figures.control_seconds;
    result.task.substeps = figures.substeps;
    result.task.episode_steps = figures.episode_steps;
    result.task.return_low = figures.return_low;
    result.task.return_high = figures.return_high;
    result.ingredients = IngredientsOf(figures);
    if (figures.notice != nullptr) result.notice = figures.notice;
    if (asked.depth == ProbeDepth::kComponents) MakeComponents(spec, components, figures);
    if (asked.depth == ProbeDepth::kCosts || asked.depth == ProbeDepth::kMemory) {
      result.costs = Rehearse(spec, components, environment.get(),
                              asked.depth == ProbeDepth::kCosts, &result.memory_bytes);
    }
    return results::FieldsToJson(result);
  });
}

ProbeResult ProbeRun(const RunSpec& spec, ProbeDepth depth, const ProcessOptions& options) {
  ChildRequest request;
  request.command = "probe";
  request.who = spec.environment.task() + ", " + spec.model.name() + ", " + spec.planner.name();
  request.timeout_seconds = kProbeTimeoutSeconds;
  request.memory_limit_bytes = LimitsOf(options, 0).memory_bytes;
  return results::FieldsFromJson<ProbeResult>(
      AskChild(request, results::FieldsToJson(ProbeRequest{spec, depth})));
}

SweepFigures ProbeSweep(std::vector<RunSpec>* specs, const ProcessOptions& options) {
  SweepFigures figures;
  std::map<std::string, ProbeResult> known;  // by configuration
  std::set<std::string> said;
  for (RunSpec& spec : *specs) {
    const auto [entry, added] = known.try_emplace(CanonicalJson(spec));
    ProbeResult& probe = entry->second;
    if (added) {
      try {
        probe = ProbeRun(spec, ProbeDepth::kComponents, options);
      } catch (const Failure& error) {
        if (error.code() == ExitCode::kUsage) throw;
        probe = ProbeRun(spec, ProbeDepth::kTask, options);
      }
      if (!probe.notice.empty() && said.insert(probe.notice).second) {
        figures.notices.push_back(probe.notice);
      }
    }
    spec.environment.ingredients = probe.ingredients;
    figures.tasks.push_back(probe.task);
  }
  figures.memory_bytes = MemoryOfRuns(*specs, figures.tasks, options);
  return figures;
}

std::uint64_t MemoryOfRuns(const std::vector<RunSpec>& specs,
                           const std::vector<results::TaskInfo>& tasks,
                           const ProcessOptions& options) {
  if (options.jobs != 0 || specs.size() < 2) return 0;
  const auto numbers = [&](std::size_t i) {
    return tasks.empty() ? 0 : tasks[i].observation_size + tasks[i].action_size;
  };
  std::map<std::string, std::size_t> largest;  // by all but the task
  for (std::size_t i = 0; i < specs.size(); ++i) {
    RunSpec alike = specs[i];
    if (!tasks.empty()) alike.environment = specs.front().environment;
    const auto entry = largest.try_emplace(CanonicalJson(alike), i).first;
    if (numbers(i) > numbers(entry->second)) entry->second = i;
  }
  double most = 0;
  for (const auto& [alike, i] : largest) {
    try {
      const ProbeResult probe = ProbeRun(specs[i], ProbeDepth::kMemory, options);
      most = std::max(most, EstimateRun(specs[i], probe).memory_bytes);
    } catch (const Failure&) {
      // Its fault costs its own run.
    }
  }
  return static_cast<std::uint64_t>(most);
}

std::string ChangedIngredient(const RunSpec& spec, const ProcessOptions& options) {
  if (spec.environment.ingredients.empty()) return "";
  RunSpec now = spec;
  now.environment.ingredients.clear();
  now.environment.ingredients = ProbeRun(now, ProbeDepth::kTask, options).ingredients;
  return IngredientChange(now.environment, spec.environment.ingredients);
}

RunEstimate EstimateRun(const RunSpec& spec, const ProbeResult& probe) {
  const RunCosts& costs = probe.costs;
  const Schedule schedule(spec, static_cast<std::uint64_t>(probe.task.episode_steps));
  const auto count = [](std::uint64_t n) { return static_cast<double>(n); };
  const double evaluation_decisions =
      count(schedule.evaluations() * spec.run.Integer("eval_episodes") *
            schedule.decisions_per_episode());
  const double evaluation_steps = evaluation_decisions * spec.action_repeat();
  const bool search = !spec.eval_planner.Has(kActorAlone);
  RunEstimate estimate;
  estimate.seconds = count(spec.steps()) * costs.environment_step +
                     count(schedule.planned_decisions()) * costs.training_decision +
                     count(schedule.updates()) * costs.update +
                     evaluation_decisions * costs.actor_evaluation_decision +
                     evaluation_steps * costs.environment_step +
                     (search ? evaluation_decisions * costs.search_evaluation_decision +
                                   evaluation_steps * costs.environment_step
                             : 0);
  // Measured: about 50 bytes a decision row, 150 an episode or scalar row.
  const double episodes = count(schedule.training_episodes());
  const double scalars =
      episodes * count(spec.planner.info->metrics.size() + spec.model.info->metrics.size() + 6);
  estimate.database_bytes =
      50 * count(schedule.decisions()) +
      150 * (episodes + count(schedule.evaluations() * spec.run.Integer("eval_episodes") * 2)) +
      50 * scalars + 20000;
  // Two checkpoints are kept and a third is written before one goes.
  estimate.checkpoint_bytes =
      costs.checkpoint_bytes + costs.replay_row_bytes * count(schedule.replay_rows());
  estimate.file_bytes = 3 * estimate.checkpoint_bytes;
  if (probe.memory_bytes > 0) {
    estimate.memory_bytes =
        probe.memory_bytes + kDatabaseCacheBytes +
        (spec.evaluation ? 0 : ReplayRowBytes(spec, probe.task) * count(schedule.replay_rows()));
  }
  return estimate;
}

double SecondsToWrite(double bytes, const std::filesystem::path& database) {
  std::filesystem::path folder = std::filesystem::absolute(database).parent_path();
  std::error_code error;
  while (!std::filesystem::exists(folder, error) && folder.has_relative_path()) {
    folder = folder.parent_path();
  }
  FileDescriptor file(::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600));
  if (file.get() < 0) {
    std::string name = (folder / ".dreamsearch-XXXXXX").string();
    file = FileDescriptor(::mkostemp(name.data(), O_CLOEXEC));
    if (file.get() < 0) return 0;
    ::unlink(name.c_str());
  }
  const std::string block(1 << 20, 'x');
  const double begin = ActivityClock::Now();
  double written = 0;
  for (; written < std::min(bytes, kMostTrialBytes); written += static_cast<double>(block.size())) {
    if (!WriteAll(file.get(), block)) return 0;
  }
  if (written == 0 || ::fsync(file.get()) != 0) return 0;
  return (ActivityClock::Now() - begin) * std::max(1.0, bytes / written);
}

}  // namespace dreamsearch
