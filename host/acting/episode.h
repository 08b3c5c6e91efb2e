// episode.h - evaluation episodes, and how an action is held.
//
// Training, `runner eval` and `runner explain` play evaluation episodes with this one
// class, so that episode i of a run seed is the same wherever it is played.
//
// Episodes are played side by side: each has an environment, a planner and an agent of
// its own, and what they ask the model goes to it together (joint_model.h), so that the
// actor alone costs three requests a decision for all of them, and with a search the
// leaves of all trees go in one. An episode's bits do not depend on what is played
// beside it. Its times are its share: its own, and of every joint request an equal part
// with those who asked.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dreamsearch/environment.h"
#include "host/acting/agent.h"
#include "host/acting/components.h"
#include "host/acting/joint_model.h"
#include "host/acting/root_ranking.h"
#include "results/database/run_writer.h"

namespace dreamsearch {

bool AllFinite(View<const double> values);
double Mean(const std::vector<double>& values);   // 0 for none
double Percentile95(std::vector<double> values);  // 0 for none

// What holding an action gave.
struct HeldAction {
  double reward = 0;  // summed over the steps
  double discount = 1;
  bool last = false;
  std::uint64_t steps = 0;  // environment steps made
  // What the environment said if it reported a divergence (kDiverged): the episode is over, and
  // this action led nowhere. Empty: it did not.
  std::string diverged;
};

// Environment::Reset. `name` is the environment's, for messages. Throws Failure.
void ResetEnvironment(Environment* environment, const std::string& name, std::uint32_t seed,
                      View<double> observation);

// Applies an action of [-1, 1]^A for up to `most_steps` environment steps, at least
// one, fewer if the episode ends. observation: [O], what it led to. `name` is the
// environment's, for messages. Throws Failure 72 for what is not finite although the environment
// reported no divergence.
HeldAction HoldAction(Environment* environment, const std::string& name, View<const double> action,
                      std::uint64_t most_steps, View<double> observation);

// Throws Failure 69 if an episode that goes on after `length` environment steps has
// outlived what the environment says of itself.
void CheckLength(const Environment& environment, const std::string& name, std::uint64_t length);
// The same if the return of a whole episode lies outside the declared range.
void CheckReturn(const EnvironmentSpec& spec, const std::string& name, double episode_return);

// What is to be played, and what becomes of it. Of several calls for one episode the
// order is that in which they stand here.
struct EpisodeCourse {
  // Takes the next episode: its index within its evaluation, which decides its seeds.
  // Nothing once none is left.
  std::function<std::optional<std::uint64_t>()> next;
  // The environment is in the state after t decisions: at the episode's start, where `held` is
  // null, and after each action; `held` says what that led to. May be empty.
  std::function<void(std::uint64_t index, std::uint64_t t, Environment* environment,
                     const HeldAction* held)>
      arrived;
  // Before decision t; false breaks the episode off: nothing follows for it.
  std::function<bool(std::uint64_t index, std::uint64_t t)> go_on;
  // Where decision t reports its tree, or null. May be empty.
  std::function<TreeSink*(std::uint64_t index, std::uint64_t t)> tree;
  // After decision t of the agent. May be empty.
  std::function<void(std::uint64_t index, std::uint64_t t, const Decision&, const Agent&)> decided;
  // After that, of the decisions that Parts::ranks says; `tree` is not asked for these. May be
  // empty.
  std::function<void(std::uint64_t index, std::uint64_t t, const RootRanking&)> ranked;
  // The environment reported a divergence after `t` decisions: the row that follows has the
  // return so far. May be empty.
  std::function<void(std::uint64_t index, std::uint64_t t, const std::string& message)> diverged;
  // All of the row but phase, episode and env_step.
  std::function<void(std::uint64_t index, const results::EpisodeRow& row)> ended;
  // A Failure ended it. No further episode is taken in its place.
  std::function<void(std::uint64_t index, std::exception_ptr error)> failed;
};

// The faults of episodes that are played side by side or by several threads. Which of
// them is met does not depend on how many: it is that of the first episode that has one,
// as if they had been played one after another.
class EpisodeFaults {
 public:
  void Add(std::uint64_t index, std::exception_ptr error) { faults_[index] = std::move(error); }
  bool empty() const { return faults_.empty(); }
  // False if the fault of an earlier episode makes this one pointless.
  bool MayGoOn(std::uint64_t index) const {
    return faults_.empty() || index <= faults_.begin()->first;
  }
  // The first fault's episode, or `otherwise`.
  std::uint64_t FirstOr(std::uint64_t otherwise) const {
    return faults_.empty() ? otherwise : faults_.begin()->first;
  }
  void RethrowFirst() const {
    if (!faults_.empty()) std::rethrow_exception(faults_.begin()->second);
  }

 private:
  std::map<std::uint64_t, std::exception_ptr> faults_;
};

class EpisodePlayers {
 public:
  // Episodes played at once are no more: their joint requests are large enough.
  static constexpr std::uint64_t kMost = 16;

  struct Parts {
    JointModel* model = nullptr;
    // At least one for each of the model's seats; must outlive the players.
    std::span<const EnvironmentPtr> environments;
    // One for each seat.
    std::vector<PlannerPtr> planners;
    Agent::Parts agent;  // of each, but for what is its own
    std::string environment_name;
    std::uint64_t action_repeat = 1;
    std::uint64_t run_seed = 0;
    RankingSpec ranks;
  };
  explicit EpisodePlayers(Parts parts);

  // Parts of a run's evaluation: what plays it.
  enum class Who { kPlanner, kEvaluationPlanner, kActor };
  static Parts PartsOf(const RunSpec& spec, const Components& components, Who who,
                       JointModel* model, std::span<const EnvironmentPtr> environments);

  // Plays the course to its end. env_step: environment steps of training behind the agent.
  void Play(const EpisodeCourse& course, std::uint64_t env_step);

 private:
  // False if it was broken off.
  bool PlayOne(std::size_t seat, std::uint64_t index, const EpisodeCourse& course,
               std::uint64_t env_step, results::EpisodeRow* row);

  Parts parts_;
  // Of each seat.
  std::vector<std::unique_ptr<Agent>> agents_;
  std::vector<std::unique_ptr<RootRanker>> rankers_;  // none unless decisions are ranked
};

}  // namespace dreamsearch
