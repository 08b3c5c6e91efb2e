#include "host/acting/episode_groups.h"

#include <algorithm>
#include <functional>
#include <mutex>
#include <span>
#include <system_error>
#include <thread>

#include "host/plugins/call_site.h"

namespace dreamsearch {
namespace {

template <typename Result, typename... Arguments>
std::function<Result(Arguments...)> OneAtATime(std::mutex* mutex,
                                               const std::function<Result(Arguments...)>& call) {
  if (!call) return {};
  return [mutex, &call](Arguments... arguments) {
    const std::lock_guard lock(*mutex);
    return call(arguments...);
  };
}

}  // namespace

EpisodeGroups::EpisodeGroups(const RunSpec& spec, const Components& components, Model* model,
                             std::size_t episodes)
    : spec_(spec), components_(components), model_(model) {
  for (std::size_t i = 0; i < episodes; ++i) {
    environments_.push_back(components_.MakeEnvironment());
  }
}

EpisodeGroups::~EpisodeGroups() = default;

void EpisodeGroups::Deal(std::size_t groups) {
  if (groups == groups_.size()) return;
  groups_.clear();
  // Made one after the other: a plugin's factories need not bear two threads.
  while (copies_.size() + 1 < groups) {
    Copy copy;
    if (spec_.model.Has(kNeedsEnvironment)) copy.environment = components_.MakeEnvironment();
    copy.model = components_.MakeModel(environments_.front()->spec(), 1, copy.environment.get());
    copies_.push_back(std::move(copy));
  }
  for (std::size_t i = 0; i < groups; ++i) {
    Model* model = i == 0 ? model_ : copies_[i - 1].model.get();
    const std::size_t episodes = environments_.size();
    groups_.emplace_back().joint =
        std::make_unique<JointModel>(model, episodes / groups + (i < episodes % groups ? 1 : 0));
  }
}

void EpisodeGroups::BringCopiesUpToDate() {
  for (std::size_t i = 1; i < groups_.size(); ++i) {
    CopyModel(*model_, spec_.model.name(), copies_[i - 1].model.get());
  }
}

void EpisodeGroups::Play(EpisodePlayers::Who who, const EpisodeCourse& course,
                         std::uint64_t env_step, std::uint32_t threads) {
  if (environments_.empty()) return;
  Deal(std::clamp<std::size_t>(threads, 1, environments_.size()));
  BringCopiesUpToDate();
  std::span<const EnvironmentPtr> environments = environments_;
  for (Group& group : groups_) {
    std::optional<EpisodePlayers>& players = group.players[static_cast<std::size_t>(who)];
    if (!players) {
      players.emplace(EpisodePlayers::PartsOf(spec_, components_, who, group.joint.get(),
                                              environments.first(group.joint->seats())));
    }
    environments = environments.subspan(group.joint->seats());
  }

  std::mutex mutex;
  EpisodeCourse shared;
  shared.next = OneAtATime(&mutex, course.next);
  shared.arrived = OneAtATime(&mutex, course.arrived);
  shared.go_on = OneAtATime(&mutex, course.go_on);
  shared.tree = OneAtATime(&mutex, course.tree);
  shared.decided = OneAtATime(&mutex, course.decided);
  shared.diverged = OneAtATime(&mutex, course.diverged);
  shared.ended = OneAtATime(&mutex, course.ended);
  shared.failed = OneAtATime(&mutex, course.failed);
  const auto play = [&](Group* group) {
    group->players[static_cast<std::size_t>(who)]->Play(shared, env_step);
  };
  if (groups_.size() > 1) model_->SetThreads(1);
  {
    std::vector<std::jthread> others;  // joined at the scope's end
    try {
      for (std::size_t i = 1; i < groups_.size(); ++i) {
        others.emplace_back([&play, group = &groups_[i]] {
          const SiteWaitedFor site;
          play(group);
        });
      }
    } catch (const std::system_error&) {  // no thread is to be had: those that there are play all
    }
    play(&groups_.front());
  }
  if (groups_.size() > 1) model_->SetThreads(threads);
}

}  // namespace dreamsearch
