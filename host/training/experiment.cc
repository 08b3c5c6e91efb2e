#include "host/training/experiment.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <utility>
#include <vector>

#include "host/plugins/call_site.h"
#include "host/settings/schedule.h"
#include "host/training/resumption.h"
#include "results/system/digest.h"
#include "results/system/error.h"

namespace dreamsearch {

Experiment::Experiment(const RunSpec& spec, const Options& options, results::RunWriter* writer,
                       std::filesystem::path folder)
    : spec_(spec),
      options_(options),
      writer_(writer),
      folder_(std::move(folder)),
      target_(spec.steps()),
      components_(spec_),
      environment_(components_.MakeEnvironment()),
      model_environment_(spec_.model.Has(kNeedsEnvironment) ? components_.MakeEnvironment()
                                                            : nullptr),
      model_(components_.MakeModel(environment_->spec(), 1, model_environment_.get())),
      planner_(components_.MakePlanner(*model_)),
      groups_(spec_, components_, model_.get(),
              std::min<std::uint64_t>(EpisodePlayers::kMost, spec_.run.Integer("eval_episodes"))),
      replay_(environment_->spec().observation_size, environment_->spec().action_size,
              Schedule(spec_, environment_->spec().episode_steps).replay_capacity(),
              spec_.search_candidates()),
      eval_every_(Schedule(spec_, environment_->spec().episode_steps).eval_every()),
      clock_(options.segment_started, options.gflop_per_second),
      observation_(environment_->spec().observation_size),
      action_(environment_->spec().action_size),
      episode_metrics_(components_.planner().metrics.size),
      burst_metrics_(components_.model().metrics.size),
      metrics_(components_.model().metrics.size) {
  Agent::Parts parts;
  parts.model = model_.get();
  parts.model_name = spec_.model.name();
  parts.planner = planner_.get();
  parts.SetPlanner(spec_.planner);
  parts.environment = environment_.get();
  parts.model_needs_environment = spec_.model.Has(kNeedsEnvironment);
  parts.run_seed = spec_.seed;
  parts.exploration_hold = spec_.run.Integer("exploration_hold");
  parts.policy_actions = spec_.search_candidates();
  agent_ = std::make_unique<Agent>(parts);

  const std::uint64_t episode_steps =
      std::min<std::uint64_t>(environment_->spec().episode_steps, target_);
  plan_us_.reserve(episode_steps);
  episode_actions_.reserve(episode_steps * environment_->spec().action_size);

  if (spec_.run.Number("reanalyse") > 0) {
    reanalysis_ = std::make_unique<Reanalysis>(spec_, components_, model_.get());
  }

  planner_metric_ids_ = MetricIds(spec_.planner, writer_);
  model_metric_ids_ = MetricIds(spec_.model, writer_);
}

Experiment::~Experiment() = default;

Experiment::Outcome Experiment::Run(const std::atomic<bool>* stop, const Watcher& watcher) {
  stop_ = stop;
  watcher_ = watcher;
  try {
    while (at_.stage != Stage::kDone) {
      if (Stopping()) {
        const std::optional<Failure> trouble = writer_->trouble();
        WriteCheckpoint(true);  // if the trouble lasts, this throws
        if (trouble) throw Failure(*trouble);
        return Outcome::kInterrupted;
      }
      switch (at_.stage) {
        case Stage::kEvaluate:
          AdjustThreads();
          Watch(RunStage::kEvaluating);
          if (!Evaluate()) break;  // a stop was asked for
          at_.stage = at_.env_step >= target_ ? Stage::kDone : Stage::kEpisodeStart;
          break;
        case Stage::kEpisodeStart:
          MaybeCheckpoint();
          BeginEpisode();
          at_.stage = Stage::kEpisode;
          break;
        case Stage::kEpisode:
          if (at_.pending_updates > 0) {
            AdjustThreads();
            MakeUpdate();
            Watch(RunStage::kLearning);
            break;
          }
          if (options_.keep_replay && target_ - at_.env_step <= spec_.action_repeat()) {
            WriteCheckpoint(true);  // what follows happens only because the budget ends here
          }
          MakeDecision();
          Watch(episode_.random != 0 ? RunStage::kExploring : RunStage::kInteracting);
          break;
        case Stage::kLearn:
          if (at_.pending_updates > 0) {
            AdjustThreads();
            MakeUpdate();
            Watch(RunStage::kLearning);
          } else {
            FinishUpdates();
          }
          break;
        case Stage::kDone:
          break;
      }
    }
  } catch (const Failure& error) {
    if (error.code() == ExitCode::kDiverged) DumpDivergence(error.what());
    throw;
  }
  WriteCheckpoint(false);
  RecordTimeUse();  // again, with the checkpoint's own time
  Watch(RunStage::kFinished);
  return Outcome::kFinished;
}

bool Experiment::Stopping() const {
  return stop_->load(std::memory_order_relaxed) || writer_->trouble();
}

void Experiment::Watch(RunStage stage) {
  RunProgress progress;
  progress.stage = stage;
  progress.env_step = at_.env_step;
  progress.training_return = at_.last_training_return;
  progress.evaluation_return = at_.last_evaluation_return;
  if (at_.stage == Stage::kEvaluate) progress.decisions = groups_.episodes();
  progress.threads = threads_;
  watcher_(progress);
}

void Experiment::BeginEpisode() {
  const ActivityScope scope(&clock_, Activity::kEnvironment);
  episode_ = EpisodeState();
  ResetEnvironment(environment_.get(), spec_.environment.name(), EnvironmentSeed(),
                   {observation_.data(), observation_.size()});
  if (!AllFinite({observation_.data(), observation_.size()})) {
    throw Failure(ExitCode::kDiverged, "environment '" + spec_.environment.name() +
                                           "': the first observation is not finite");
  }
  replay_.BeginEpisode({observation_.data(), observation_.size()});
  episode_.random = at_.env_step < spec_.run.Integer("prefill_steps") ? 1 : 0;
  episode_.transitions_before = agent_->transitions();
  std::fill(action_.begin(), action_.end(), 0.0);
  std::fill(episode_metrics_.begin(), episode_metrics_.end(), 0.0);
  plan_us_.clear();
  episode_actions_.clear();
  trees_.clear();
  agent_->BeginEpisode(EpisodePurpose::kTraining, at_.training_episodes);
}

void Experiment::MakeDecision() {
  const double begin = ActivityClock::Now();
  Decision decision;
  if (episode_.random != 0) {
    const std::uint64_t seed = SeedAt(at_.env_step);
    const std::uint64_t drawn = HeldDecision(seed, EpisodePurpose::kTraining, at_.training_episodes,
                                             episode_.t, spec_.run.Integer("exploration_hold"));
    Random random(SeedFor(seed, SeedUse::kRandomAction, EpisodePurpose::kTraining,
                          at_.training_episodes, drawn));
    for (double& entry : action_) entry = random.Uniform(-1, 1);
  } else {
    const ActivityScope scope(&clock_, Activity::kPlanning);
    tree_.Clear();
    agent_->set_run_seed(SeedAt(at_.env_step));
    decision = agent_->Decide({observation_.data(), observation_.size()}, true, at_.env_step,
                              options_.record_trees ? &tree_ : nullptr);
    std::copy(agent_->action().begin(), agent_->action().end(), action_.begin());
    if (spec_.search_candidates() > 0) {
      replay_.SetSearch({agent_->policy_actions(), agent_->policy_weights(), decision.value});
    }
  }
  HeldAction held;
  {
    const ActivityScope scope(&clock_, Activity::kEnvironment);
    held =
        HoldAction(environment_.get(), spec_.environment.name(), {action_.data(), action_.size()},
                   std::min<std::uint64_t>(target_ - at_.env_step, spec_.action_repeat()),
                   {observation_.data(), observation_.size()});
    if (!held.diverged.empty()) return EndDivergedEpisode(held.diverged);
    replay_.Add({action_.data(), action_.size()}, held.reward, held.discount,
                {observation_.data(), observation_.size()});
    episode_actions_.insert(episode_actions_.end(), action_.begin(), action_.end());
  }
  if (episode_.random == 0) {
    if (options_.record_trees) KeepTree(decision);
    for (std::size_t i = 0; i < episode_metrics_.size(); ++i) {
      episode_metrics_[i] += agent_->metrics()[i];
    }
  }
  at_.env_step += held.steps;
  ++at_.decisions;
  episode_.length += held.steps;
  episode_.episode_return += held.reward;
  results::EpisodeDigest digest(episode_.digest);
  digest.AddDecision(action_.data(), action_.size(), held.reward, decision.value);
  episode_.digest = digest.state();
  plan_us_.push_back(decision.plan_us);

  const ActivityScope scope(&clock_, Activity::kRecording);
  results::StepRow row;
  row.env_step = Signed(at_.env_step);
  row.episode = Signed(at_.training_episodes);
  row.t = Signed(episode_.t);
  row.reward = held.reward;
  row.value = decision.value;
  row.plan_us = std::llround(decision.plan_us);
  row.simulations = decision.simulations;
  row.nodes = decision.nodes;
  row.depth = decision.depth;
  writer_->AddStep(row);
  if (options_.log_decisions && episode_.random == 0) {
    for (std::size_t i = 0; i < planner_metric_ids_.size(); ++i) {
      writer_->AddScalar(Signed(at_.env_step), planner_metric_ids_[i], agent_->metrics()[i]);
    }
  }
  ++episode_.t;
  episode_.wall_seconds += ActivityClock::Now() - begin;
  if (held.discount == 0 && ++at_.terminal_states == 1 && !environment_->spec().terminates) {
    WarnOfTerminalState();
  }
  if (!held.last) CheckLength(*environment_, spec_.environment.name(), episode_.length);
  if (held.last || at_.env_step >= target_) {
    at_.diverged_in_a_row = 0;
    if (held.last) {
      CheckReturn(environment_->spec(), spec_.environment.name(), episode_.episode_return);
    }
    FinishEpisode();
  } else if (at_.pretrained != 0 && spec_.run.Flag("train_within_episode")) {
    EarnUpdates();
  }
}

void Experiment::WarnOfTerminalState() {
  const std::string message =
      "environment '" + spec_.environment.name() +
      "' gave a terminal state (discount 0) although its spec says that it has none "
      "(EnvironmentSpec::terminates); the model may learn values as if its episodes went on";
  writer_->AddEvent(Signed(at_.env_step), "warning", "terminal_state", message);
  std::cerr << "warning: " << message << "\n";
}

void Experiment::FinishEpisode() {
  const ActivityScope scope(&clock_, Activity::kRecording);
  if (!trees_.empty()) {
    AddArtifact(WriteCheckpointFile(TreesPath(folder_, at_.training_episodes),
                                    [&](CheckpointWriter* file) { SaveTrees(file); }),
                "trees");
    trees_.clear();
  }
  replay_.EndEpisode();
  results::EpisodeRow row;
  row.phase = results::Phase::kTraining;
  row.episode = Signed(at_.training_episodes);
  row.env_step = Signed(at_.env_step);
  row.length = Signed(episode_.length);
  row.episode_return = episode_.episode_return;
  row.wall_seconds = episode_.wall_seconds;
  row.plan_us_mean = Mean(plan_us_);
  row.plan_us_p95 = Percentile95(plan_us_);
  row.model_transitions = Signed(agent_->transitions() - episode_.transitions_before);
  row.digest = episode_.digest;
  writer_->AddEpisode(row);
  if (episode_.random == 0 && !options_.log_decisions && episode_.t > 0) {
    for (std::size_t i = 0; i < planner_metric_ids_.size(); ++i) {
      writer_->AddScalar(Signed(at_.env_step), planner_metric_ids_[i],
                         episode_metrics_[i] / static_cast<double>(episode_.t));
    }
  }
  at_.last_training_return = episode_.episode_return;
  ++at_.training_episodes;

  if (at_.pretrained != 0) {
    EarnUpdates();
  } else if (at_.env_step >= spec_.run.Integer("prefill_steps") && spec_.model.Has(kLearns)) {
    at_.pretrained = 1;
    at_.pending_updates = spec_.run.Integer("pretrain_updates");
    at_.learned_env_step = at_.env_step;
  }
  at_.stage = Stage::kLearn;
  writer_->SetProgress(Signed(at_.env_step));
  writer_->TryCommit();
}

void Experiment::EarnUpdates() {
  const auto train_every = spec_.run.Integer("train_every");
  const std::uint64_t times = (at_.env_step - at_.learned_env_step) / train_every;
  at_.pending_updates = times * spec_.run.Integer("updates");
  at_.learned_env_step += times * train_every;
}

void Experiment::AdjustThreads() {
  if (options_.threads == nullptr) return;
  const std::uint32_t threads = std::max(1u, options_.threads->load(std::memory_order_relaxed));
  if (threads == threads_) return;
  model_->SetThreads(threads);
  threads_ = threads;
}

void Experiment::MakeUpdate() {
  const ActivityScope scope(&clock_, Activity::kLearning);
  const SequenceBatch batch = replay_.Sample(
      spec_.run.Integer("batch_size"), spec_.run.Integer("sequence_length"),
      SeedFor(spec_.seed, SeedUse::kReplay, EpisodePurpose::kTraining, at_.updates, 0));
  if (reanalysis_ != nullptr) {
    const ActivityScope planning(&clock_, Activity::kPlanning);
    reanalysis_->Renew(batch, at_.updates, at_.env_step, &replay_);
  }
  TrainRequest request;
  request.batch = &batch;
  request.seed = SeedFor(spec_.seed, SeedUse::kTrain, EpisodePurpose::kTraining, at_.updates, 0);
  request.update = at_.updates;
  request.environment_step = at_.env_step;
  std::fill(metrics_.begin(), metrics_.end(), std::numeric_limits<double>::quiet_NaN());
  const CallScope call({"model", spec_.model.name().c_str(), "Train", "update", at_.updates});
  const Status status = model_->Train(request, {metrics_.data(), metrics_.size()});
  const std::string what =
      "model '" + spec_.model.name() + "' update " + std::to_string(at_.updates);
  ThrowUnlessOk(status, what);
  for (std::size_t i = 0; i < metrics_.size(); ++i) {
    if (!std::isfinite(metrics_[i])) {
      throw Failure(ExitCode::kDiverged, what + ": " + components_.model().metrics[i].name +
                                             " was not set, or is not finite");
    }
    burst_metrics_[i] += metrics_[i];
  }
  writer_->CommitIfDue();
  ++at_.burst_updates;
  ++at_.updates;
  --at_.pending_updates;
}

void Experiment::FinishUpdates() {
  {
    const ActivityScope scope(&clock_, Activity::kRecording);
    if (at_.burst_updates > 0) {
      for (std::size_t i = 0; i < model_metric_ids_.size(); ++i) {
        writer_->AddScalar(Signed(at_.env_step), model_metric_ids_[i],
                           burst_metrics_[i] / static_cast<double>(at_.burst_updates));
      }
      at_.burst_updates = 0;
      std::fill(burst_metrics_.begin(), burst_metrics_.end(), 0.0);
    }
  }
  const bool spent = at_.env_step >= target_;
  const bool due = at_.env_step / eval_every_ > at_.evaluated_mark;
  at_.stage = spent || due ? Stage::kEvaluate : Stage::kEpisodeStart;
  RecordTimeUse();
}

void Experiment::RecordTimeUse() {
  const ActivityScope scope(&clock_, Activity::kRecording);
  const ActivityClock::Use& use = clock_.Totals();
  for (std::size_t i = 0; i < kActivities; ++i) {
    writer_->AddTimeUse({Signed(at_.env_step), results::kActivities[i], use.seconds[i],
                         use.processor_seconds[i], use.gflop[i]});
  }
  writer_->TryCommit();
}

void Experiment::MaybeCheckpoint() {
  const auto every = spec_.run.Integer("checkpoint_every");
  if (at_.env_step >= at_.checkpoint_env_step + every) WriteCheckpoint(true);
}

}  // namespace dreamsearch
