#include "host/training/evaluation.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <limits>
#include <map>
#include <mutex>
#include <thread>

#include "host/acting/activity_clock.h"
#include "host/plugins/call_site.h"
#include "host/plugins/catalogue.h"
#include "host/training/resumption.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

constexpr PartName kEvaluationPart{"evaluation", 1};

// What is recorded of the decisions that were ranked, beside the planner's metrics: the mean of
// each over those that had an order to find, and last how many these were.
struct RankingMetric {
  const char* name;
  const char* unit;
  const char* help;
  double RootRanking::*number;
};
constexpr RankingMetric kRankingMetrics[] = {
    {"ranking.correlation", "",
     "Rank correlation of the root's Q with the returns in the simulator.",
     &RootRanking::correlation},
    {"ranking.first_visits", "", "Share of the root's visits that its first action has.",
     &RootRanking::first_visits},
    {"ranking.regret", "reward",
     "Return in the simulator of the root's best action less that of the played one.",
     &RootRanking::regret},
    {"ranking.spread", "reward",
     "Return in the simulator of the root's best action less that of its worst.",
     &RootRanking::spread},
    {"ranking.decisions", "decisions", "Decisions ranked whose actions had different returns.",
     nullptr},
};

}  // namespace

EvaluationPlayer::EvaluationPlayer(const Components& components, const RunSpec& spec,
                                   const std::optional<Checkpoint>& agent,
                                   std::uint32_t model_threads, std::size_t episodes)
    : env_step_(spec.evaluation->env_step) {
  for (std::size_t i = 0; i < episodes; ++i) {
    environments_.push_back(components.MakeEnvironment());
  }
  const EnvironmentSpec& task = environments_.front()->spec();
  if (spec.model.Has(kNeedsEnvironment)) model_environment_ = components.MakeEnvironment();
  trained_ = components.MakeTrainedModel(task, model_threads);
  model_ = components.MakeModel(task, model_threads, model_environment_.get(), trained_.get());
  if (trained_ != nullptr) {
    LoadModel(*agent, spec.evaluation->trained_model->name(), trained_.get());
  } else if (agent) {
    LoadModel(*agent, spec.model.name(), model_.get());
  }
  joint_ = std::make_unique<JointModel>(model_.get(), episodes);
  players_ = std::make_unique<EpisodePlayers>(EpisodePlayers::PartsOf(
      spec, components, EpisodePlayers::Who::kPlanner, joint_.get(), environments_));
}

std::optional<Checkpoint> OpenAgent(const RunSpec& spec, const std::filesystem::path& checkpoint) {
  if (spec.evaluation->parent_uuid.empty()) return std::nullopt;
  std::optional<Checkpoint> agent;
  std::string found;
  try {
    agent.emplace(checkpoint);
    found = ModelSha256(*agent);
  } catch (const Failure& error) {
    throw Failure(error.code(), std::string(error.what()) +
                                    ": the trained run has gone on or its files were moved. "
                                    "`runner eval` again takes its newest checkpoint");
  }
  if (found != spec.evaluation->agent_sha256) {
    throw Failure(ExitCode::kBadInput, checkpoint.string() +
                                           " holds another agent: expected SHA-256 " +
                                           spec.evaluation->agent_sha256 + ", found " + found +
                                           ". `runner eval` again takes what is there now");
  }
  return agent;
}

// An episode that has ended.
struct Evaluation::Played {
  std::string diverged;  // what ended it, if that was a divergence
  results::EpisodeRow row;
  std::uint64_t decisions = 0;
  std::vector<double> metric_sums;
};

// What is to be played, for the players, and what is to be recorded, for the recording thread.
class Evaluation::EpisodeQueue {
 public:
  EpisodeQueue(std::uint64_t first, std::uint64_t end) : next_(first), end_(end) {}

  // The next episode to play; nothing once all are taken or something went wrong.
  std::optional<std::uint64_t> Take() {
    const std::lock_guard lock(mutex_);
    if (next_ == end_ || !faults_.empty()) return std::nullopt;
    return next_++;
  }
  bool MayGoOn(std::uint64_t index) {
    const std::lock_guard lock(mutex_);
    return !stop.load(std::memory_order_relaxed) && faults_.MayGoOn(index);
  }
  void Deliver(std::uint64_t index, Played played) {
    const std::lock_guard lock(mutex_);
    played_[index] = std::move(played);
    changed_.notify_all();
  }
  void Fail(std::uint64_t index, std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    faults_.Add(index, std::move(error));
    changed_.notify_all();
  }
  // A finished episode if it is there, after waiting a moment for it.
  std::optional<Played> Collect(std::uint64_t index) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::milliseconds(100),
                      [&] { return played_.count(index) != 0 || !faults_.MayGoOn(index + 1); });
    const auto found = played_.find(index);
    if (found == played_.end()) return std::nullopt;
    Played played = std::move(found->second);
    played_.erase(found);
    return played;
  }
  // The first episode that cannot be recorded.
  std::uint64_t end() {
    const std::lock_guard lock(mutex_);
    return faults_.FirstOr(end_);
  }
  void RethrowError() {
    const std::lock_guard lock(mutex_);
    faults_.RethrowFirst();
  }

  std::atomic<std::uint64_t> env_steps{0};  // played by all threads
  std::atomic<bool> stop{false};

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t next_;
  const std::uint64_t end_;
  std::map<std::uint64_t, Played> played_;
  EpisodeFaults faults_;
};

Evaluation::Evaluation(const RunSpec& spec, const Options& options, results::RunWriter* writer,
                       std::filesystem::path folder)
    : spec_(spec),
      options_(options),
      writer_(writer),
      folder_(std::move(folder)),
      components_(spec_),
      metric_ids_(MetricIds(spec_.planner, writer_)) {
  planner_metrics_ = metric_ids_.size();
  if (spec_.evaluation->ranks.every > 0) {
    for (const RankingMetric& metric : kRankingMetrics) {
      metric_ids_.push_back(writer_->Metric(metric.name, metric.unit, metric.help));
    }
  }
  at_.metric_sums.resize(metric_ids_.size());
}

Evaluation::~Evaluation() = default;

void Evaluation::Load(const Checkpoint& checkpoint) {
  checkpoint.Read(kEvaluationPart, [&](StateReader* reader) {
    at_.Fields(reader);
    const std::uint64_t most = spec_.run.Integer("eval_episodes");
    if (at_.episodes > most) {
      reader->Refuse("field 'episodes': expected at most " + std::to_string(most) + ", found " +
                     std::to_string(at_.episodes));
    }
    if (at_.metric_sums.size() == metric_ids_.size()) return;
    reader->Refuse("field 'metric_sums': expected " + std::to_string(metric_ids_.size()) +
                   " entries, found " + std::to_string(at_.metric_sums.size()));
  });
}

results::ResumePoint Evaluation::ResumePointOf(const Checkpoint& checkpoint,
                                               std::uint64_t env_step) {
  const auto position = checkpoint.Value<Position>(kEvaluationPart);
  results::ResumePoint point;
  point.env_step = static_cast<std::int64_t>(env_step);
  point.search_evaluation_episodes = static_cast<std::int64_t>(position.episodes);
  point.actor_evaluation_episodes = static_cast<std::int64_t>(position.episodes);
  point.events = static_cast<std::int64_t>(position.events);
  return point;
}

void Evaluation::Record(const Played& played, double seconds) {
  if (!played.diverged.empty()) {
    writer_->AddEvent(static_cast<std::int64_t>(env_step()), "warning", "divergence",
                      played.diverged);
  }
  writer_->AddEpisode(played.row);
  ++at_.episodes;
  at_.decisions += played.decisions;
  at_.env_steps += static_cast<std::uint64_t>(played.row.length);
  at_.return_sum += played.row.episode_return;
  at_.seconds = seconds;
  for (std::size_t i = 0; i < at_.metric_sums.size(); ++i) {
    at_.metric_sums[i] += played.metric_sums[i];
  }
  for (std::size_t i = 0; i < at_.metric_sums.size(); ++i) {
    const bool ranking = i >= planner_metrics_, count = ranking && i + 1 == at_.metric_sums.size();
    const double decisions = ranking ? at_.metric_sums.back() : static_cast<double>(at_.decisions);
    if (decisions == 0 && !count) continue;
    writer_->AddScalar(static_cast<std::int64_t>(env_step()), metric_ids_[i],
                       at_.metric_sums[i] / (count ? 1 : decisions));
  }
  writer_->AddTimeUse({static_cast<std::int64_t>(env_step()), "evaluation", seconds});
  writer_->SetProgress(static_cast<std::int64_t>(env_step()));
  writer_->Commit();
  at_.events = static_cast<std::uint64_t>(writer_->events());
  CheckpointFolder(folder_).Write(
      at_.episodes,
      [&](CheckpointWriter* checkpoint) {
        checkpoint->Value(kHeaderPart, options_.header);
        checkpoint->Value(kEvaluationPart, at_);
        AddRowSums(*writer_, checkpoint);
      },
      at_.episodes - 1);
}

RunLoop::Outcome Evaluation::Run(const std::atomic<bool>* stop, const Watcher& watcher) {
  const double started = ActivityClock::Now();
  const double seconds_before = at_.seconds;
  const std::uint64_t episodes = spec_.run.Integer("eval_episodes");
  const std::optional<Checkpoint> agent = OpenAgent(spec_, options_.agent);
  const std::uint64_t left = episodes - at_.episodes;
  const std::uint64_t threads = std::min<std::uint64_t>(std::max(options_.threads, 1u), left);
  const std::uint64_t together =
      std::min(EpisodePlayers::kMost, threads == 0 ? 0 : (left + threads - 1) / threads);
  // Made one after the other: a plugin's factories need not bear two threads.
  std::vector<std::unique_ptr<EvaluationPlayer>> players;
  for (std::size_t i = 0; i < threads; ++i) {
    players.push_back(std::make_unique<EvaluationPlayer>(components_, spec_, agent, 1, together));
  }

  EpisodeQueue queue(at_.episodes, episodes);
  const auto play = [&](EvaluationPlayer* player) {
    const SiteWaitedFor site;
    std::map<std::uint64_t, Played> playing;  // of this thread
    EpisodeCourse course;
    course.next = [&] {
      const std::optional<std::uint64_t> index = queue.Take();
      if (index) playing[*index].metric_sums.resize(at_.metric_sums.size());
      return index;
    };
    course.go_on = [&](std::uint64_t index, std::uint64_t) { return queue.MayGoOn(index); };
    course.decided = [&](std::uint64_t index, std::uint64_t, const Decision&,
                         const Agent& player_agent) {
      Played& played = playing[index];
      ++played.decisions;
      queue.env_steps += spec_.action_repeat();
      for (std::size_t i = 0; i < planner_metrics_; ++i) {
        played.metric_sums[i] += player_agent.metrics()[i];
      }
    };
    course.ranked = [&](std::uint64_t index, std::uint64_t, const RootRanking& ranking) {
      if (!ranking.ordered) return;
      double* sum = playing[index].metric_sums.data() + planner_metrics_;
      for (const RankingMetric& metric : kRankingMetrics) {
        *sum++ += metric.number == nullptr ? 1 : ranking.*metric.number;
      }
    };
    course.diverged = [&](std::uint64_t index, std::uint64_t t, const std::string& message) {
      playing[index].diverged = message + "; episode " + std::to_string(index) + " ended after " +
                                std::to_string(t) + " decisions and has the return so far";
    };
    course.ended = [&](std::uint64_t index, const results::EpisodeRow& row) {
      Played played = std::move(playing[index]);
      playing.erase(index);
      played.row = row;
      played.row.phase = spec_.planner.Has(kActorAlone) ? results::Phase::kActorEvaluation
                                                        : results::Phase::kSearchEvaluation;
      played.row.episode = static_cast<std::int64_t>(index);
      played.row.env_step = static_cast<std::int64_t>(env_step());
      queue.Deliver(index, std::move(played));
    };
    course.failed = [&](std::uint64_t index, std::exception_ptr error) {
      queue.Fail(index, std::move(error));
    };
    player->Play(course);
  };

  const std::uint64_t steps_before = at_.env_steps;
  std::uint64_t watched = std::numeric_limits<std::uint64_t>::max();
  {
    std::vector<std::jthread> playing;  // joined at the scope's end
    // However this scope is left, the players are told to end first.
    struct Stopper {
      std::atomic<bool>* stop;
      ~Stopper() { *stop = true; }
    };
    const Stopper stopper{&queue.stop};
    for (const auto& player : players) playing.emplace_back(play, player.get());
    while (at_.episodes < queue.end() && !*stop) {
      const std::optional<Played> played = queue.Collect(at_.episodes);
      if (played) Record(*played, seconds_before + ActivityClock::Now() - started);
      const std::uint64_t env_steps = queue.env_steps;
      if (env_steps == watched) continue;  // a plugin that hangs makes no progress
      watched = env_steps;
      writer_->CommitIfDue();
      if (writer_->trouble()) throw Failure(*writer_->trouble());
      RunProgress progress;
      progress.stage = RunStage::kEvaluating;
      progress.decisions = threads * together;
      progress.env_step = steps_before + env_steps;
      if (at_.episodes > 0) {
        progress.evaluation_return = at_.return_sum / static_cast<double>(at_.episodes);
      }
      watcher(progress);
    }
  }
  if (*stop && at_.episodes < queue.end()) return Outcome::kInterrupted;
  queue.RethrowError();
  return Outcome::kFinished;
}

}  // namespace dreamsearch
