// episode.h - an evaluation episode, and how an action is held.
//
// Training, `runner eval` and `runner explain` play evaluation episodes with this one
// function, so that episode i of a run seed is the same wherever it is played.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "agent.h"
#include "dreamsearch/environment.h"
#include "results/run_writer.h"

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
};

// Applies an action of [-1, 1]^A for up to `most_steps` environment steps, at least
// one, fewer if the episode ends. observation: [O], what it led to. `name` is the
// environment's, for messages. Throws RunnerError 72 for what is not finite.
HeldAction HoldAction(Environment* environment, const std::string& name, View<const double> action,
                      std::uint64_t most_steps, View<double> observation);

// Throws RunnerError 69 if an episode that goes on after `length` environment steps has
// outlived what the environment says of itself.
void CheckLength(const Environment& environment, const std::string& name, std::uint64_t length);

struct EvaluationEpisode {
  Agent* agent = nullptr;
  Environment* environment = nullptr;
  std::string environment_name;
  std::uint64_t action_repeat = 1;
  std::uint64_t run_seed = 0;
  std::uint64_t index = 0;     // of the episode within its evaluation; decides its seeds
  std::uint64_t env_step = 0;  // environment steps of training behind the agent
};

struct EpisodeHooks {
  // Before decision t; false breaks the episode off.
  std::function<bool(std::uint64_t t)> go_on;
  // Where decision t reports its tree, or null. May be empty.
  std::function<TreeSink*(std::uint64_t t)> tree;
  // After decision t. May be empty.
  std::function<void(std::uint64_t t, const Decision& decision)> decided;
};

// Plays one to its end; fills *row but for phase, episode and env_step. False if it
// was broken off: *row is then unset.
bool PlayEvaluationEpisode(const EvaluationEpisode& episode, const EpisodeHooks& hooks,
                           results::EpisodeRow* row);

}  // namespace dreamsearch
