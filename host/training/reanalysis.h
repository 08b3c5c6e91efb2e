// reanalysis.h - searches of sampled states, made anew with the present model.
//
// What a search found is worth less the more the model has changed since. So of each update's
// states a share, run.reanalyse, is searched again before the update (Schrittwieser et al. 2021;
// Wang et al. 2025), as the training's planner searches while it collects, but from a belief and
// a planner that begin with the sampled sequence: no warm start, no kept tree. The share counts
// over updates: where it is less than a state, some updates plan none.
//
// The beliefs of all chosen sequences are updated together, and all roots are planned together,
// the leaves of their trees in one request (joint_model.h). How many stand beside each other
// changes no bit. A run's time for it is charged to planning.
//
// Errors   Failure, that of the first row whose search fails.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dreamsearch/planning.h"
#include "host/acting/components.h"
#include "host/acting/joint_model.h"
#include "host/plugins/model_proxy.h"
#include "host/settings/run_spec.h"
#include "host/training/replay.h"

namespace dreamsearch {

class Reanalysis {
 public:
  // Roots planned at once are no more: their joint requests are large enough.
  static constexpr std::uint64_t kMostRoots = 64;

  // The run keeps searches. All that is handed over must outlive it.
  Reanalysis(const RunSpec& spec, const Components& components, Model* model);

  // Searches the update's share of the states of `batch`, the replay's last sample, and puts
  // what is found into it and into the replay.
  void Renew(const SequenceBatch& batch, std::uint64_t update, std::uint64_t environment_step,
             Replay* replay);

 private:
  // A planner in its seat, and what it found last.
  struct Seat {
    std::unique_ptr<ModelProxy> proxy;
    PlannerPtr planner;
    std::vector<double> action, metrics, policy_actions, policy_weights;
    std::optional<PlanResult> result;
    Status status;

    MatrixView<double> policy() {
      return {policy_actions.data(), policy_weights.size(), action.size()};
    }
    View<double> weights() { return {policy_weights.data(), policy_weights.size()}; }
  };

  void Choose(std::uint64_t rows, std::uint64_t update);
  // Leaves the chosen rows' latents in roots_.
  void Believe(const SequenceBatch& batch, std::uint64_t update);
  std::uint64_t Seed(std::uint64_t update, std::uint64_t draw) const;

  const RunSpec& spec_;
  Model* const model_;
  const std::string model_text_, planner_text_;
  const double share_;
  JointModel joint_;
  std::vector<Seat> seats_;
  std::vector<std::uint64_t> rows_;    // scratch of Choose
  std::vector<std::uint64_t> chosen_;  // rows of the batch, ascending
  LatentBuffer roots_;                 // of these
  // Of the sequences that hold a chosen row, at one time.
  LatentBuffer previous_, next_;
  std::vector<std::uint64_t> sequences_, seeds_;
  std::vector<double> actions_, observations_;
};

}  // namespace dreamsearch
