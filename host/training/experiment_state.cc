// experiment_state.cc - a training's state in checkpoints and other files of its run.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "host/plugins/call_site.h"
#include "host/training/experiment.h"
#include "host/training/resumption.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/sha256.h"
#include "results/text/json_text.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr PartName kTrainingPart{"training", 2};
constexpr PartName kReplayPart{"replay", 1};
constexpr PartName kEpisodePart{"episode", 1};
constexpr PartName kTreesPart{"trees", 1};

// Of a StateWriter or a StateReader.
template <typename Use, typename Part>
void TimeUseFields(Use&& use, Part* part) {
  part->Array("activity_seconds", use.seconds.data(), kActivities);
  part->Array("activity_processor_seconds", use.processor_seconds.data(), kActivities);
  part->Array("activity_gflop", use.gflop.data(), kActivities);
}

}  // namespace

std::filesystem::path Experiment::TreesPath(const std::filesystem::path& folder,
                                            std::uint64_t episode) {
  return folder / ("trees-" + std::to_string(episode) + ".trees");
}

Experiment::Trees Experiment::ReadTrees(const std::filesystem::path& path) {
  Trees trees;
  Checkpoint(path).Read(kTreesPart, [&](StateReader* part) { VisitMap(part, "trees", &trees); });
  return trees;
}

void Experiment::KeepTree(const Decision& decision) {
  const ActivityScope scope(&clock_, Activity::kRecording);
  if (tree_.faulty()) {
    throw Failure(ExitCode::kInternal, "planner '" + spec_.planner.name() +
                                           "' reported an edge before its parent, or memory "
                                           "ran out");
  }
  if (tree_.edges().empty()) return;
  const std::vector<double> metrics(agent_->metrics().begin(), agent_->metrics().end());
  nlohmann::json json =
      TreeJson(tree_, agent_->action(), decision, metrics, components_.planner().metrics);
  json["env_step"] = at_.env_step;
  trees_[episode_.t] = results::JsonText(json);
}

void Experiment::SaveTrees(CheckpointWriter* file) const {
  file->Part(kTreesPart, [&](StateWriter* part) {
    Trees trees = trees_;
    VisitMap(part, "trees", &trees);
  });
}

void Experiment::WriteCheckpoint(bool with_replay) {
  const ActivityScope scope(&clock_, Activity::kRecording);
  // The rows before the checkpoint first: a resume relies on them.
  writer_->SetProgress(Signed(at_.env_step));
  writer_->Commit();
  const std::uint64_t before = at_.checkpoint_env_step;
  at_.checkpoint_env_step = at_.env_step;
  at_.events = static_cast<std::uint64_t>(writer_->events());
  const WrittenFile written = CheckpointFolder(folder_).Write(
      at_.env_step,
      [&](CheckpointWriter* checkpoint) {
        Save(checkpoint, with_replay);
        AddRowSums(*writer_, checkpoint);
      },
      before);
  AddArtifact(written, "checkpoint");
  writer_->Commit();
}

void Experiment::AddArtifact(const WrittenFile& file, const std::string& kind) {
  writer_->AddArtifact(file.path.string(), kind, Signed(at_.env_step), Signed(file.bytes),
                       file.sha256);
}

void Experiment::DumpDivergence(const std::string& message) {
  writer_->AddEvent(Signed(at_.env_step), "error", "divergence", message);
  try {
    AddArtifact(
        WriteCheckpointFile(folder_ / ("divergence-" + std::to_string(at_.env_step) + ".ckpt"),
                            [&](CheckpointWriter* checkpoint) { Save(checkpoint, true); }),
        "divergence");
  } catch (const Failure& error) {
    writer_->AddEvent(Signed(at_.env_step), "warning", "no_state_dump", error.what());
  }
  writer_->Commit();
}

std::uint64_t Experiment::SeedAt(std::optional<std::uint64_t> env_step) const {
  return SeedWithRetries(spec_.seed, options_.retries, at_.training_episodes, env_step);
}

std::uint32_t Experiment::EnvironmentSeed() const {
  return static_cast<std::uint32_t>(SeedFor(SeedAt(std::nullopt), SeedUse::kEnvironment,
                                            EpisodePurpose::kTraining, at_.training_episodes, 0));
}

void Experiment::EndDivergedEpisode(const std::string& message) {
  ++at_.diverged_episodes;
  ++at_.diverged_in_a_row;
  writer_->AddEvent(Signed(at_.env_step), "warning", "divergence",
                    message + "; training episode " + std::to_string(at_.training_episodes) +
                        " ended after " + std::to_string(episode_.t) + " decisions");
  DumpEpisode(message);
  const std::uint64_t most = spec_.run.Integer("diverged_episodes");
  if (at_.diverged_in_a_row >= most) {
    throw Failure(ExitCode::kDiverged, message + "; so ended " + Counted(most, "episode") +
                                           " in a row, as many as run.diverged_episodes allows");
  }
  FinishEpisode();
}

// What plays the episode again, up to the action that diverged.
void Experiment::DumpEpisode(const std::string& message) {
  constexpr std::uint64_t kMostDumps = 20;
  if (at_.diverged_episodes > kMostDumps) return;
  nlohmann::json actions = nlohmann::json::array();
  const auto add = [&](const double* action) {
    actions.push_back(std::vector<double>(action, action + action_.size()));
  };
  for (std::size_t t = 0; t < episode_.t; ++t) add(episode_actions_.data() + t * action_.size());
  add(action_.data());
  const std::string text = results::JsonText({{"environment", spec_.environment.task()},
                                              {"message", message},
                                              {"seed", EnvironmentSeed()},
                                              {"action_repeat", spec_.action_repeat()},
                                              {"actions", actions}}) +
                           "\n";
  WrittenFile file;
  file.path = folder_ / ("divergence-" + std::to_string(at_.training_episodes) + ".json");
  file.bytes = text.size();
  file.sha256 = Sha256Hex(text);
  try {
    WriteWholeFile(file.path, text);
    AddArtifact(file, "divergence");
  } catch (const Failure& error) {
    writer_->AddEvent(Signed(at_.env_step), "warning", "no_episode_dump", error.what());
  }
}

void Experiment::Save(CheckpointWriter* checkpoint, bool with_replay) const {
  checkpoint->Value(kHeaderPart, options_.header);
  checkpoint->Part(kTrainingPart, [&](StateWriter* part) {
    Position(at_).Fields(part);
    TimeUseFields(const_cast<ActivityClock&>(clock_).Totals(), part);
    (*part)("burst_metrics", &burst_metrics_);
  });
  SaveModel(*model_, spec_.model.name(), checkpoint);
  if (with_replay) {
    checkpoint->Part(kReplayPart, [&](StateWriter* part) { replay_.Save(part); });
  }
  if (at_.stage == Stage::kEpisode) {
    checkpoint->Part(kEpisodePart, [&](StateWriter* part) { SaveEpisode(part); });
    SaveTrees(checkpoint);
  }
}

void Experiment::SaveEpisode(StateWriter* part) const {
  EpisodeState(episode_).Fields(part);
  (*part)("observation", &observation_);
  (*part)("action", &action_);
  (*part)("actions", &episode_actions_);
  (*part)("plan_us", &plan_us_);
  (*part)("metric_sums", &episode_metrics_);
  auto* saving = ExtensionOf<StateSaving>(environment_.get());
  std::vector<std::byte> state(saving != nullptr ? saving->state_bytes() : 0);
  if (!state.empty()) {
    const CallScope scope({"environment", spec_.environment.name().c_str(), "SaveState"});
    ThrowUnlessOk(saving->SaveState({state.data(), state.size()}),
                  "environment '" + spec_.environment.name() + "' SaveState");
  }
  (*part)("environment_state", &state);
  agent_->Save(part);
}

void Experiment::Load(const Checkpoint& checkpoint) {
  LoadModel(checkpoint, spec_.model.name(), model_.get());
  checkpoint.Read(kTrainingPart, [&](StateReader* part) {
    at_.Fields(part);
    CheckPosition(*part);
    ActivityClock::Use use;
    TimeUseFields(use, part);
    clock_.set_totals(use);
    part->Array("burst_metrics", burst_metrics_.data(), burst_metrics_.size());
  });
  if (at_.stage == Stage::kDone) return;
  checkpoint.Read(kReplayPart, [&](StateReader* part) {
    replay_.Load(part);
    const std::vector<Replay::Episode>& episodes = replay_.episodes();
    const bool under_way = !episodes.empty() && episodes.back().finished == 0;
    if (under_way != (at_.stage == Stage::kEpisode)) {
      part->Refuse("the replay's last episode has ended otherwise than the training's");
    }
  });
  if (at_.stage != Stage::kEpisode) return;
  checkpoint.Read(kTreesPart, [&](StateReader* part) { VisitMap(part, "trees", &trees_); });
  checkpoint.Read(kEpisodePart, [&](StateReader* part) { LoadEpisode(part); });
}

// What does not come about in a training of these settings is refused: it would go on for ever, or
// past the end of something.
void Experiment::CheckPosition(const StateReader& part) const {
  const auto check = [&](const char* name, std::uint64_t found, std::uint64_t most) {
    if (found <= most) return;
    part.Refuse(std::string("field '") + name + "': expected at most " + std::to_string(most) +
                ", found " + std::to_string(found));
  };
  const std::uint64_t earned =
      at_.env_step / spec_.run.Integer("train_every") * spec_.run.Integer("updates");
  check("stage", static_cast<std::uint64_t>(at_.stage), static_cast<std::uint64_t>(Stage::kDone));
  check("env_step", at_.env_step, target_);
  check("decisions", at_.decisions, at_.env_step);
  check("learned_env_step", at_.learned_env_step, at_.env_step);
  check("checkpoint_env_step", at_.checkpoint_env_step, at_.env_step);
  check("pretrained", at_.pretrained, 1);
  check("pending_updates", at_.pending_updates,
        std::max(earned, spec_.run.Integer("pretrain_updates")));
}

void Experiment::LoadEpisode(StateReader* part) {
  episode_.Fields(part);
  part->Array("observation", observation_.data(), observation_.size());
  part->Array("action", action_.data(), action_.size());
  (*part)("actions", &episode_actions_);
  if (episode_.t != episode_actions_.size() / action_.size() ||
      episode_actions_.size() % action_.size() != 0) {
    part->Refuse("field 'actions': expected those of " + std::to_string(episode_.t) +
                 " decisions, found " + std::to_string(episode_actions_.size()) + " numbers");
  }
  if (const std::uint64_t rows = replay_.episodes().back().rows; rows != episode_.t + 1) {
    part->Refuse("field 't': expected " + std::to_string(rows - 1) +
                 " decisions, as many as the replay has of this episode, found " +
                 std::to_string(episode_.t));
  }
  (*part)("plan_us", &plan_us_);
  part->Array("metric_sums", episode_metrics_.data(), episode_metrics_.size());
  auto* saving = ExtensionOf<StateSaving>(environment_.get());
  std::vector<std::byte> state(saving != nullptr ? saving->state_bytes() : 0);
  part->Array("environment_state", state.data(), state.size());
  if (!state.empty()) {
    const CallScope scope({"environment", spec_.environment.name().c_str(), "RestoreState"});
    ThrowUnlessOk(saving->RestoreState({state.data(), state.size()}),
                  "environment '" + spec_.environment.name() + "' RestoreState");
  } else {
    // No saved state: live the episode again. The same seed and actions give the
    // same bits.
    std::vector<double> observation(observation_.size());
    const View<double> view{observation.data(), observation.size()};
    ResetEnvironment(environment_.get(), spec_.environment.name(), EnvironmentSeed(), view);
    for (std::uint64_t t = 0; t < episode_.t; ++t) {
      HoldAction(environment_.get(), spec_.environment.name(),
                 {episode_actions_.data() + t * action_.size(), action_.size()},
                 spec_.action_repeat(), view);
    }
  }
  agent_->Load(part);
}

bool Experiment::IsWithinEpisode(const Checkpoint& checkpoint) {
  return checkpoint.Has(kEpisodePart);
}

bool Experiment::HasReplay(const Checkpoint& checkpoint) { return checkpoint.Has(kReplayPart); }

std::unique_ptr<Replay> Experiment::ReadReplay(const Checkpoint& checkpoint, const RunSpec& spec) {
  std::unique_ptr<Replay> replay;
  checkpoint.Read(kReplayPart, [&](StateReader* part) {
    replay = Replay::Read(spec.search_candidates(), part);
  });
  return replay;
}

results::ResumePoint Experiment::ResumePointOf(const Checkpoint& checkpoint) {
  Position position;
  checkpoint.Read(kTrainingPart, [&](StateReader* part) {
    position.Fields(part);
    ActivityClock::Use use;
    TimeUseFields(use, part);
    std::vector<double> burst_metrics;
    (*part)("burst_metrics", &burst_metrics);
  });
  results::ResumePoint point;
  point.env_step = Signed(position.env_step);
  point.training_episodes = Signed(position.training_episodes);
  point.search_evaluation_episodes = Signed(position.evaluation_episodes);
  point.actor_evaluation_episodes = Signed(position.evaluation_episodes);
  point.events = Signed(position.events);
  return point;
}

}  // namespace dreamsearch
