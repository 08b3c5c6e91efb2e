// learning.h - what learners of different models do alike: batches are checked, observations
// standardised, returns measured, groups of parameters moved, saved and exported.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/stream.h"
#include "plugins/networks/layers.h"

namespace dreamsearch::networks {

// kInvalidArgument: a view has the wrong size.
Status CheckSequences(const SequenceBatch& batch, Index observations, Index actions);

// Running mean and variance of each observation component over the training
// batches: the n-th batch counts 1/n. Kept in double.
struct ObservationStatistics {
  explicit ObservationStatistics(Index size)
      : mean(static_cast<std::size_t>(size), 0.0), variance(static_cast<std::size_t>(size), 1.0) {}
  // Becomes `before` with the batch.
  void Include(const ObservationStatistics& before, MatrixView<const float> observations);

  Status Write(ByteSink* sink) const;  // without the number of batches
  Status Read(ByteSource* source);
  Status Export(TensorSink* sink) const;

  std::uint64_t batches = 0;
  std::vector<double> mean;      // [O]
  std::vector<double> variance;  // [O]
};

struct Standardisation {
  bool active = false;  // otherwise x = o, as before the first batch
  double floor = 0.01;
  double clip = 10;
};

// x = clip((o - mean) / max(deviation, floor)). observations: [n, O] row-major, x: [O, n].
template <typename T, typename S>
void Standardise(const ObservationStatistics& statistics, const Standardisation& how,
                 const S* observations, Mat<T> x) {
  const bool active = how.active && statistics.batches > 0;
  for (Index i = 0; i < x.rows; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double mean = active ? statistics.mean[k] : 0;
    const double inverse =
        active ? 1.0 / std::max(std::sqrt(statistics.variance[k]), how.floor) : 1;
    for (Index j = 0; j < x.cols; ++j) {
      double value = (static_cast<double>(observations[j * x.rows + i]) - mean) * inverse;
      // Comparisons that leave NaN as it is.
      if (active && value > how.clip) value = how.clip;
      if (active && value < -how.clip) value = -how.clip;
      x(i, j) = static_cast<T>(value);
    }
  }
}

// S of "percentile return scale" (Hafner et al. 2023; Hansen et al. 2024): a moving average
// of the 5 to 95 percent range of returns.
struct PercentileScale {
  // What to divide by: 1 before the first returns and where the range is smaller.
  double divisor() const { return std::max(1.0, range); }
  // Reorders `returns`. The first ones set the average.
  template <typename T>
  void Include(std::vector<T>* returns, double rate, bool first);

  double range = 0;
};

struct AdamSettings {
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-7;
  double gradient_clip = 0;  // largest norm of a gradient; longer ones are shortened
};

template <typename T>
double GradientNorm(const ParameterGroup<T>& group) {
  return std::sqrt(SumOfSquares(group.gradient(), group.size()));
}

// The `step`-th Adam step of the group, the first is 1; `norm` is its gradient's or that of
// all groups that are shortened together. Pack is left to the caller.
template <typename T>
void MoveGroup(const AdamSettings& adam, double learning_rate, double norm, std::uint64_t step,
               ParameterGroup<T>* group);

// A copy of a group's values that follows them slowly.
template <typename T>
class SlowCopy {
 public:
  // After the group's Allocate. `rounded`: products in bfloat16.
  void Allocate(const ParameterGroup<T>& group, bool rounded);
  void Reset(const ParameterGroup<T>& group);  // to the group's present values
  void Follow(const ParameterGroup<T>& group, double rate) {
    MoveTowards(group.values(), static_cast<T>(rate), group.size(), values_.data());
  }
  // After the values have changed.
  void Pack();
  Weights<T> weights(Bfloat16Scratch* scratch) const {
    return {values_.data(), packed_.get(), rounded_.get(), scratch};
  }
  std::vector<T>& values() { return values_; }
  const std::vector<T>& values() const { return values_; }

 private:
  std::vector<T> values_;
  std::unique_ptr<PackedWeights<T>> packed_;
  std::unique_ptr<Bfloat16Weights> rounded_;
};

template <typename T>
Status WriteArray(ByteSink* sink, const T* values, Index count) {
  return sink->Write(values, static_cast<std::uint64_t>(count) * sizeof(T));
}
template <typename T>
Status ReadArray(ByteSource* source, T* values, Index count) {
  return source->Read(values, static_cast<std::uint64_t>(count) * sizeof(T));
}

// A learner's state as it is saved and exported: where its parts are.
template <typename T>
struct LearnerState {
  std::uint64_t mark = 0;  // of the format
  Index observations = 0, actions = 0;
  PercentileScale* return_scale = nullptr;
  ObservationStatistics* statistics = nullptr;
  std::vector<T>* slow = nullptr;          // values of the slow copy
  std::vector<ParameterGroup<T>*> groups;  // with Adam's moments
  std::vector<std::uint64_t*> counters;
  // A copy that acts in place of its group: its values; null: none.
  const ParameterGroup<T>* acting_group = nullptr;
  std::vector<T>* acting = nullptr;

  // Begins with what marks it: the mark, bytes a number, sizes of observation, action and every
  // group, a hash of all tensors' names and shapes.
  Status Save(ByteSink* sink) const;
  // kDataLoss says for which of them `model` finds another. Pack is left to the caller.
  Status Load(const char* model, ByteSource* source) const;
  // Every tensor in single precision, a weight as [out, in], slowest first. Those of the copy that
  // acts have its group's names after "acting_".
  Status Export(TensorSink* sink) const;

 private:
  std::vector<std::uint64_t> Header() const;
};

}  // namespace dreamsearch::networks
