// episode_groups.h - a training's evaluation episodes, on as many threads as the run has.
//
// The episodes are dealt to groups. Each group has a thread, a model and seats of its own
// (joint_model.h), so that nothing is shared but the course: the first group plays in the run's
// own model, the others in copies of it, brought up to date before each evaluation. No episode's
// bits depend on how many groups there are.
//
// Threads  the calls of a course come one at a time, from any group's thread.
// Errors   as EpisodePlayers. What a copy cannot load is a Failure 70, that of the model.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "host/acting/components.h"
#include "host/acting/episode.h"
#include "host/acting/joint_model.h"
#include "host/settings/settings.h"

namespace dreamsearch {

class EpisodeGroups {
 public:
  // As many `episodes` are played at once. All three must outlive it.
  EpisodeGroups(const RunSpec& spec, const Components& components, Model* model,
                std::size_t episodes);
  ~EpisodeGroups();

  std::size_t episodes() const { return environments_.size(); }

  // Plays the course to its end on so many threads, which are what `model` uses afterwards, too.
  // env_step: environment steps of training behind the agent.
  void Play(EpisodePlayers::Who who, const EpisodeCourse& course, std::uint64_t env_step,
            std::uint32_t threads);

 private:
  // A model of the run's kind.
  struct Copy {
    EnvironmentPtr environment;  // if it needs one
    ModelPtr model;
  };
  struct Group {
    std::unique_ptr<JointModel> joint;
    std::optional<EpisodePlayers> players[3];  // of each EpisodePlayers::Who, once it is asked for
  };

  // Deals the episodes to so many groups.
  void Deal(std::size_t groups);
  void BringCopiesUpToDate();

  const RunSpec& spec_;
  const Components& components_;
  Model* const model_;
  std::vector<EnvironmentPtr> environments_;  // of each episode
  std::vector<Copy> copies_;                  // of each group but the first
  std::vector<Group> groups_;
};

}  // namespace dreamsearch
