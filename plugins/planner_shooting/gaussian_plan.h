// gaussian_plan.h - a Gaussian over action sequences that is refitted to the best ones.
//
// Independent components, mean and standard deviation for each transition and action component.
// Drawn actions are clipped to [-1, 1].
#pragma once

#include <vector>

#include "trajectories.h"

namespace dreamsearch {

class GaussianPlan {
 public:
  GaussianPlan(std::uint64_t horizon, std::uint64_t action_size)
      : horizon_(horizon),
        size_(action_size),
        mean_(horizon * action_size),
        std_(horizon * action_size) {}

  void SetMean(double mean) noexcept { std::fill(mean_.begin(), mean_.end(), mean); }
  void SetStd(double std) noexcept { std::fill(std_.begin(), std_.end(), std); }
  // The mean of the decision before, one transition on; the last transition's is 0.
  void ShiftMean() noexcept {
    std::copy(mean_.begin() + static_cast<std::ptrdiff_t>(size_), mean_.end(), mean_.begin());
    std::fill(mean_.end() - static_cast<std::ptrdiff_t>(size_), mean_.end(), 0.0);
  }

  // The actions of the sequences from row `first` on.
  void Draw(Trajectories* trajectories, std::uint64_t first, std::uint64_t seed) const noexcept {
    Random random(seed);
    for (std::uint64_t t = 0; t < horizon_; ++t) {
      const MatrixView<double> actions = trajectories->actions(t);
      for (std::uint64_t i = first; i < actions.rows; ++i) {
        for (std::uint64_t j = 0; j < size_; ++j) Place(t, j, random.Normal(), &actions(i, j));
      }
    }
  }
  // An action component: `noise` deviations from the mean.
  void Place(std::uint64_t t, std::uint64_t j, double noise, double* component) const noexcept {
    const std::uint64_t at = t * size_ + j;
    *component = std::clamp(mean_[at] + std_[at] * noise, -1.0, 1.0);
  }

  // Fits to the sequences `elites`, by `weights` (sum 1) or equally if there are none, and keeps
  // `momentum` of what was. Deviations stay in [min_std, max_std].
  void Refit(Trajectories* trajectories, View<const std::uint32_t> elites,
             View<const double> weights, double momentum, double min_std, double max_std) noexcept {
    const double count = static_cast<double>(elites.size);
    const auto mix = [momentum](double before, double now) {
      return momentum == 0 ? now : momentum * before + (1 - momentum) * now;
    };
    for (std::uint64_t t = 0; t < horizon_; ++t) {
      const MatrixView<double> actions = trajectories->actions(t);
      for (std::uint64_t j = 0; j < size_; ++j) {
        double mean = 0, variance = 0;
        for (std::uint64_t i = 0; i < elites.size; ++i) {
          const double action = actions(elites[i], j);
          mean += weights.empty() ? action / count : weights[i] * action;
        }
        for (std::uint64_t i = 0; i < elites.size; ++i) {
          const double offset = actions(elites[i], j) - mean;
          variance += weights.empty() ? offset * offset / count : weights[i] * offset * offset;
        }
        double& mean_at = mean_[t * size_ + j];
        double& std_at = std_[t * size_ + j];
        // A mean of ones may round to more than one.
        mean_at = std::clamp(mix(mean_at, mean), -1.0, 1.0);
        std_at = std::clamp(mix(std_at, std::sqrt(variance)), min_std, max_std);
      }
    }
  }

  // [H, A], row-major. What a planner carries to the next decision.
  View<double> mean() noexcept { return {mean_.data(), mean_.size()}; }
  View<const double> mean() const noexcept { return {mean_.data(), mean_.size()}; }
  // Of the first action's component j.
  double first_std(std::uint64_t j) const noexcept { return std_[j]; }
  double MeanFirstStd() const noexcept {
    double sum = 0;
    for (std::uint64_t j = 0; j < size_; ++j) sum += std_[j] / static_cast<double>(size_);
    return sum;
  }

 private:
  const std::uint64_t horizon_;  // H
  const std::uint64_t size_;     // A
  std::vector<double> mean_;     // [H, A]
  std::vector<double> std_;      // [H, A]
};

}  // namespace dreamsearch
