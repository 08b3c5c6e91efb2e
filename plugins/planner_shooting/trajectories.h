// trajectories.h - imagines many action sequences from one latent, all together.
//
// Shapes   N sequences of H actions of A components; time is the slowest index, so
//          that the actions of one transition are a batch [N, A].
// Return   sum over t of (product of the discounts before t) * r_t and, if asked
//          for, the discounted value of the last latent.
// Memory   reserved by the constructor; nothing allocates afterwards.
#pragma once

#include <vector>

#include "dreamsearch/planning.h"

namespace dreamsearch {

// Parameters that planners over sequences share.
struct ShootingSettings : ValueUse {
  std::uint64_t candidates;  // N
  std::uint64_t horizon;     // H
  bool bootstrap;
  double noise_std;  // 0 where it is not declared
};

class Trajectories {
 public:
  // Throws std::bad_alloc, std::length_error.
  Trajectories(const PlannerContext& context, const ShootingSettings& settings);

  // Sequences from now on, at most the settings' candidates. Their actions are undefined.
  void SetCount(std::uint64_t count) noexcept { count_ = count; }

  std::uint64_t count() const noexcept { return count_; }      // N
  std::uint64_t horizon() const noexcept { return horizon_; }  // H

  // The actions of transition t, to be filled before Imagine. [N, A]
  MatrixView<double> actions(std::uint64_t t) noexcept {
    return {actions_.data() + t * count_ * action_size_, count_, action_size_};
  }
  // [N], after Imagine.
  View<const double> returns() const noexcept { return {returns_.data(), count_}; }
  // Standard deviation of the returns.
  double ReturnSpread() const noexcept;

  // Fills the actions of the first `rows` sequences by following samples of the
  // actor from `root`.
  Status FollowActor(LatentModel* model, ConstLatents root, std::uint64_t rows,
                     std::uint64_t seed) noexcept;

  // Imagines all sequences from the request's root and computes their returns, with the value of
  // the last latent in them if `bootstrap`. kNotFinite when a return is not finite.
  Status Imagine(LatentModel* model, const PlanRequest& request, bool bootstrap,
                 std::uint64_t seed) noexcept;

  // The best `count` sequences, best first, the earlier of equals first; after
  // Imagine, valid until the next call.
  View<const std::uint32_t> Best(std::uint64_t count) noexcept;

  // Every sequence as a chain of edges; q is the return from that edge on.
  void Report(TreeSink* sink) noexcept;

 private:
  // A seed for each of the first `rows` sequences, valid until the next call.
  View<const std::uint64_t> Seeds(std::uint64_t seed, std::uint64_t rows) noexcept {
    FillSeeds(seed, {seeds_.data(), rows});
    return {seeds_.data(), rows};
  }

  std::uint64_t count_;
  const std::uint64_t horizon_;
  const std::uint64_t action_size_;
  LatentBuffer latents_[2];           // [N], transitions go from one to the other
  std::vector<std::uint64_t> seeds_;  // [N]
  std::vector<double> actions_;       // [H, N, A]
  std::vector<double> rewards_;       // [H, N]
  std::vector<double> discounts_;     // [H, N]
  SearchValues search_values_;
  std::vector<double> values_;        // [N], of the last latents
  std::vector<double> returns_;       // [H, N]: from transition t on
  std::vector<std::uint32_t> order_;  // [N]
};

}  // namespace dreamsearch
