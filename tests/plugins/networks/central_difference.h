// central_difference.h - gradients against central differences, in double.
//
// Tolerance: with step h = 1e-5 a central difference of a smooth function errs by
// h^2 f'''/6 + eps f / h, about 1e-10 of f's scale; 1e-6 leaves room for sums of
// thousands of terms. DREAMSEARCH_SHOW_RESIDUALS=1 prints the largest found.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "dreamsearch/random.h"
#include "plugins/networks/layers.h"

namespace dreamsearch::networks {

using Values = std::vector<double>;
using M = Mat<double>;

inline constexpr double kStep = 1e-5;
inline constexpr double kTolerance = 1e-6;

// |a - b| relative to the larger, but absolute below `scale`.
inline double Residual(double a, double b, double scale) {
  return std::abs(a - b) / std::max({std::abs(a), std::abs(b), scale});
}

inline void Show(const std::string& name, double residual) {
  if (std::getenv("DREAMSEARCH_SHOW_RESIDUALS") != nullptr) {
    std::fprintf(stderr, "%-40s %.2e\n", name.c_str(), residual);
  }
}

inline Values Draws(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  Values values(count);
  for (double& v : values) v = random.Normal();
  return values;
}

// A walk over one array, so that a layer can take its inputs in turn.
class Slices {
 public:
  explicit Slices(double* data) : data_(data) {}
  M Take(Index rows, Index cols) {
    const M m(data_, rows, cols);
    data_ += rows * cols;
    return m;
  }

 private:
  double* data_;
};

struct Layer {
  const char* name;
  std::size_t inputs;
  std::size_t outputs;
  // Computes the outputs; then, if d_inputs is not null, the gradient of
  // sum(cotangent * output).
  std::function<void(Values* inputs, Values* outputs, Values* cotangent, Values* d_inputs)> run;
};

// A layer's gradients in all its inputs, which are drawn from `seed`.
inline void ExpectCentralDifferences(const Layer& layer, std::uint64_t seed) {
  Values inputs = Draws(layer.inputs, 100 + seed);
  Values outputs(layer.outputs), gradient(layer.inputs);
  Values cotangent = Draws(layer.outputs, 200 + seed);
  layer.run(&inputs, &outputs, &cotangent, &gradient);
  const auto loss = [&](std::size_t i, double shift) {
    const double kept = inputs[i];
    inputs[i] = kept + shift;
    layer.run(&inputs, &outputs, nullptr, nullptr);
    inputs[i] = kept;
    double total = 0;
    for (std::size_t k = 0; k < outputs.size(); ++k) total += cotangent[k] * outputs[k];
    return total;
  };
  double worst = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const double difference = (loss(i, kStep) - loss(i, -kStep)) / (2 * kStep);
    worst = std::max(worst, Residual(gradient[i], difference, 1e-2));
    ASSERT_LT(Residual(gradient[i], difference, 1e-2), kTolerance)
        << layer.name << " input " << i << ": gradient " << gradient[i] << ", difference "
        << difference;
  }
  Show(layer.name, worst);
}

// A group and the loss that its gradient is one of, recomputed after a value has changed.
struct GroupLoss {
  ParameterGroup<double>* group;
  std::function<double()> loss;
};

// The gradients that the groups hold now, in all their parameters.
inline void ExpectCentralDifferences(const std::string& name,
                                     const std::vector<GroupLoss>& groups) {
  // Copies first: every loss overwrites them.
  std::vector<Values> gradients;
  for (const auto& item : groups) {
    gradients.emplace_back(item.group->gradient(), item.group->gradient() + item.group->size());
  }
  double worst = 0;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    ParameterGroup<double>& group = *groups[g].group;
    double largest = 0;
    for (const double x : gradients[g]) largest = std::max(largest, std::abs(x));
    EXPECT_GT(largest, 1e-4) << group.name();
    for (const Tensor& tensor : group.tensors()) {
      for (Index k = 0; k < tensor.rows * tensor.cols; ++k) {
        const Index i = tensor.offset + k;
        double& value = group.values()[i];
        const double kept = value;
        value = kept + kStep;
        const double above = groups[g].loss();
        value = kept - kStep;
        const double below = groups[g].loss();
        value = kept;
        const double difference = (above - below) / (2 * kStep);
        const double gradient = gradients[g][static_cast<std::size_t>(i)];
        const double residual = Residual(gradient, difference, 1e-2 * largest);
        worst = std::max(worst, residual);
        ASSERT_LT(residual, kTolerance)
            << name << ", " << tensor.name << " entry " << k << ": gradient " << gradient
            << ", difference " << difference;
      }
    }
  }
  Show(name, worst);
}

// Moves every parameter off its initial value, so that zero biases and heads hide
// nothing.
inline void Perturb(ParameterGroup<double>* group, std::uint64_t seed) {
  Random random(seed);
  for (Index i = 0; i < group->size(); ++i) group->values()[i] += 0.1 * random.Normal();
  group->Pack();
}

}  // namespace dreamsearch::networks
