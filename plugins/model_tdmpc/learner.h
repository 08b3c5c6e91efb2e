// learner.h - one update of the agent, see lane.h for what is computed.
//
// An update takes all gradients at the same parameters, looks for anything not finite, and
// only then moves: a refused one leaves every bit as it was. The sequences are shared out
// among lanes, by their number alone, and the lanes' gradients added in order, so that the
// number of threads changes no bit.
#pragma once

#include <array>
#include <vector>

#include "dreamsearch/model.h"
#include "plugins/model_tdmpc/lane.h"
#include "plugins/networks/task_threads.h"

namespace dreamsearch::tdmpc {

template <typename T>
class Learner {
 public:
  // Works with one thread until told otherwise.
  Learner(const Settings& settings, Index observation_size, Index action_size, std::uint64_t seed);

  // From now on; fewer if the system refuses one.
  void SetThreads(Index threads) noexcept { threads_.Resize(std::min(threads, kMaxLanes)); }

  // The whole update. kNotFinite names what is not finite and leaves everything as it was;
  // kInvalidArgument: a view has the wrong size, or a sequence is shorter than two.
  Status Update(const TrainRequest& request, UpdateLosses* losses);

  // Its parts, in order. Read takes the batch, which must stay, and the draws of `seed`.
  // Gradients may be called again after a parameter has changed and the agent's Pack.
  Status Read(const SequenceBatch& batch, std::uint64_t seed);
  void Gradients(UpdateLosses* losses, const Stops<T>* stops = nullptr);
  Status CheckFinite(const UpdateLosses& losses, std::uint64_t update) const;
  void Apply(const UpdateLosses& losses);
  Stops<T> stops() const;

  Agent<T>& agent() { return agent_; }
  // Whose least value is the present target.
  const std::vector<Index>& target_critics() const { return step_.target_critics; }
  const PercentileScale& return_scale() const { return return_scale_; }
  // By the statistics so far. observations: [n, O] row-major, x: [O, n].
  void StandardiseNow(const double* observations, Mat<T> x) const {
    Standardise(statistics_, standardisation(), observations, x);
  }

  Status Save(ByteSink* sink) const { return const_cast<Learner*>(this)->State().Save(sink); }
  Status Load(ByteSource* source);
  Status Export(TensorSink* sink) const { return const_cast<Learner*>(this)->State().Export(sink); }

  static constexpr Index kMaxLanes = 4;
  static constexpr Index kSequencesPerLane = 16;  // where they are fewer

 private:
  LearnerState<T> State();
  Standardisation standardisation() const {
    return {settings_.normalise_observations, settings_.observation_floor,
            settings_.observation_clip};
  }

  Agent<T> agent_;
  const Settings& settings_;  // the agent's
  const Index o_, a_, l_;
  TaskThreads threads_{1};

  std::uint64_t updates_ = 0;
  PercentileScale return_scale_;
  ObservationStatistics statistics_;

  // The batch being learned from.
  Step<T> step_;
  ObservationStatistics next_statistics_;
  std::vector<T> first_values_;
  Index lanes_ = 0;  // in use
  std::array<Lane<T>, kMaxLanes> lane_;
};

}  // namespace dreamsearch::tdmpc
