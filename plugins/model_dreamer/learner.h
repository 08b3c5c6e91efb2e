// learner.h - one update of all three groups: world model, actor, critic.
//
// An update reads a batch, draws its noise, takes all gradients at the same
// parameters, looks for anything not finite, and only then moves: a refused
// update leaves every bit as it was. The noise and the dreams' starts depend on
// the seed alone, so the losses are a function of the parameters that can be
// differenced.
#pragma once

#include <vector>

#include "dreamsearch/model.h"
#include "plugins/model_dreamer/behaviour.h"
#include "plugins/model_dreamer/settings.h"
#include "plugins/model_dreamer/world_model.h"
#include "plugins/networks/learning.h"
#include "plugins/networks/task_threads.h"

namespace dreamsearch::dreamer {

struct UpdateLosses {
  FitLosses fit;
  DreamLosses dream;
  double model_gradient_norm = 0;  // before clipping
  double actor_gradient_norm = 0;
  double value_gradient_norm = 0;
};

template <typename T>
class Learner {
 public:
  // Works with one thread until told otherwise.
  Learner(const Settings& settings, Index observation_size, Index action_size, std::uint64_t seed);

  // From now on; fewer if the system refuses one. Every result is the same for any number of
  // threads.
  void SetThreads(Index threads) noexcept;

  const Settings& settings() const { return settings_; }
  Index observation_size() const { return o_; }
  Index action_size() const { return a_; }
  WorldModel<T>& world() { return world_; }
  Behaviour<T>& behaviour() { return behaviour_; }
  const WorldModel<T>& world() const { return world_; }
  const Behaviour<T>& behaviour() const { return behaviour_; }

  // The whole update. kNotFinite names what is not finite and leaves everything
  // as it was; kInvalidArgument: a view has the wrong size, or an episode starts
  // inside a sequence.
  Status Update(const TrainRequest& request, UpdateLosses* losses);

  // Its parts, in order. Read takes the batch, which must stay, and the draws of `seed`. Gradients
  // may be called again after a parameter has changed and PackWeights; it is FitGradients, then
  // DreamGradients with the dream's constants held at `stops`, but all of them on the
  // threads at once.
  Status Read(const SequenceBatch& batch, std::uint64_t seed);
  void Gradients(UpdateLosses* losses);
  void FitGradients(UpdateLosses* losses);
  void DreamGradients(UpdateLosses* losses, const DreamStops<T>* stops = nullptr);
  Status CheckFinite(const UpdateLosses& losses, std::uint64_t update) const;
  void Apply(const UpdateLosses& losses);

  // Lays the weights out for products; after parameters were changed from outside.
  void PackWeights();

  // Of observations by the statistics so far. observations: [n, O] row-major, x: [O, n].
  template <typename S>
  void StandardiseNow(const S* observations, Mat<T> x) const {
    Standardise(statistics_, standardisation(), observations, x);
  }

  Status Save(ByteSink* sink) const { return const_cast<Learner*>(this)->State().Save(sink); }
  Status Load(ByteSource* source);
  Status Export(TensorSink* sink) const { return const_cast<Learner*>(this)->State().Export(sink); }

 private:
  LearnerState<T> State();
  Standardisation standardisation() const {
    return {settings_.normalise_observations, settings_.observation_floor,
            settings_.observation_clip};
  }
  // Shares the dream out and returns the number of its tasks, which are to be begun in
  // order. They follow the posterior as it unrolls and leave the gradients and their norms.
  Index BeginDream(const DreamStops<T>* stops);
  void DreamTask(Index task, UpdateLosses* losses);

  Settings settings_;
  Index o_, a_;
  TaskThreads threads_{1};
  WorldModel<T> world_;
  Behaviour<T> behaviour_;
  std::uint64_t updates_ = 0;
  PercentileScale return_scale_;
  ObservationStatistics statistics_;

  // The batch being learned from.
  ObservationStatistics next_statistics_;
  SequenceBatch update_batch_;
  Sequences<T> batch_;
  std::vector<Index> starts_;  // columns of the posterior, ascending
  std::vector<Index> firsts_;  // see Sequences
  std::vector<Index> candidates_;
  Progress states_known_;  // columns of the posterior
  Index lanes_ = 0;
  std::vector<T> returns_copy_;
  Buffer<T> observations_, actions_, rewards_, continues_, noise_, latent_noise_, action_noise_;
};

}  // namespace dreamsearch::dreamer
