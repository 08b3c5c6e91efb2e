#include "plugins/networks/layers.h"

#include <algorithm>
#include <cmath>

#include "dreamsearch/random.h"

namespace dreamsearch::networks {
namespace {

// Columns taken through all layers together: their activations stay in the
// second-level cache from one layer to the next.
constexpr Index kColumnsAtOnce = 256;

// Square: rows made orthonormal by Gram and Schmidt, twice each for accuracy.
void Orthonormal(Random* random, Index n, std::vector<double>* rows) {
  rows->resize(static_cast<std::size_t>(n * n));
  double* q = rows->data();
  for (Index i = 0; i < n; ++i) {
    for (Index k = 0; k < n; ++k) q[i * n + k] = random->Normal();
    for (int pass = 0; pass < 2; ++pass) {
      for (Index j = 0; j < i; ++j) {
        double dot = 0;
        for (Index k = 0; k < n; ++k) dot += q[i * n + k] * q[j * n + k];
        for (Index k = 0; k < n; ++k) q[i * n + k] -= dot * q[j * n + k];
      }
    }
    double norm = 0;
    for (Index k = 0; k < n; ++k) norm += q[i * n + k] * q[i * n + k];
    norm = std::sqrt(norm);
    for (Index k = 0; k < n; ++k) q[i * n + k] /= norm;
  }
}

template <typename T>
void Initialise(const Tensor& tensor, std::uint64_t seed, T* values) {
  Random random(seed);
  const Index block_rows = tensor.rows / tensor.blocks;
  for (Index block = 0; block < tensor.blocks; ++block) {
    T* corner = values + block * block_rows;
    std::vector<double> orthonormal;
    if (tensor.initial == Initial::kOrthogonal) Orthonormal(&random, block_rows, &orthonormal);
    const double limit = std::sqrt(6.0 / static_cast<double>(block_rows + tensor.cols)) *
                         (tensor.initial == Initial::kGlorotHundredth ? 0.01 : 1.0);
    for (Index j = 0; j < tensor.cols; ++j) {
      for (Index i = 0; i < block_rows; ++i) {
        double value = 0;
        switch (tensor.initial) {
          case Initial::kZero:
            break;
          case Initial::kOne:
            value = 1;
            break;
          case Initial::kGlorot:
          case Initial::kGlorotHundredth:
            value = random.Uniform(-limit, limit);
            break;
          case Initial::kNormalFiftieth:
            value = 0.02 * random.Normal();
            break;
          case Initial::kOrthogonal:
            value = orthonormal[static_cast<std::size_t>(i * block_rows + j)];
            break;
        }
        corner[j * tensor.rows + i] = static_cast<T>(value);
      }
    }
  }
}

}  // namespace

template <typename T>
Index ParameterGroup<T>::Add(const std::string& name, Index rows, Index cols, Initial initial,
                             Index blocks) {
  constexpr Index kAlignment = 16;  // values; every tensor starts on a 64-byte line
  const Index offset = (size_ + kAlignment - 1) / kAlignment * kAlignment;
  tensors_.push_back({name, rows, cols, blocks, offset, initial});
  size_ = offset + rows * cols;
  return offset;
}

template <typename T>
Index ParameterGroup<T>::AddPart(Index offset, Index rows, Index first, Index cols) {
  parts_.push_back({offset, rows, first, cols});
  return static_cast<Index>(parts_.size()) - 1;
}

template <typename T>
void ParameterGroup<T>::Allocate(std::uint64_t seed, Rounding rounding) {
  values_.Reserve(size_ + kBiasOverrun);
  gradient_.Reserve(size_);
  first_.Reserve(size_);
  second_.Reserve(size_);
  for (std::size_t i = 0; i < tensors_.size(); ++i) {
    Initialise(tensors_[i], DeriveSeed(seed, i), values_.data() + tensors_[i].offset);
  }
  packed_ = std::make_unique<PackedWeights<T>>(parts_);
  rounding_ = rounding;
  if (rounding.any()) rounded_ = std::make_unique<Bfloat16Weights>(parts_);
  Pack();
}

template <typename T>
void ParameterGroup<T>::Pack() {
  packed_->Pack(values_.data());
  if constexpr (std::is_same_v<T, float>) {
    if (rounded_ != nullptr) rounded_->Pack(values_.data());
  }
}

template <typename T>
void ParameterGroup<T>::ClearGradient() {
  std::memset(gradient_.data(), 0, static_cast<std::size_t>(size_) * sizeof(T));
}

template <typename T>
void Mlp::Reserve(Index columns, MlpTape<T>* tape) const {
  if (tape->buffers.empty()) {
    tape->buffers = std::vector<ActivationBuffers<T>>(activation_.size());
    tape->hidden.resize(activation_.size());
  }
  for (std::size_t i = 0; i < activation_.size(); ++i) {
    tape->hidden[i] =
        tape->buffers[i].Shape(affine_[i].out(), columns, activation_[i].normalised());
  }
}

template <typename T>
void Mlp::Forward(const Weights<T>& weights, In<T> x, Index first, MlpTape<T>* tape,
                  Mat<T> out) const {
  for (Index at = 0; at < x.cols; at += kColumnsAtOnce) {
    const Index n = std::min(kColumnsAtOnce, x.cols - at);
    In<T> input = x.Cols(at, n);
    for (std::size_t i = 0; i < activation_.size(); ++i) {
      const ActivationTape<T> hidden = tape->hidden[i].Cols(first + at, n);
      affine_[i].Forward(weights, input, hidden.output);
      activation_[i].Forward(weights, hidden);
      input = hidden.output;
    }
    if (affine_.size() > activation_.size()) {
      affine_.back().Forward(weights, input, out.Cols(at, n));
    }
  }
}

template <typename T>
void Mlp::Backward(const Weights<T>& weights, In<T> x, Index first, const MlpTape<T>& tape,
                   In<T> d_out, MlpScratch<T>* scratch, T* gradient, Mat<T> d_x) const {
  for (Index at = 0; at < x.cols; at += kColumnsAtOnce) {
    const Index n = std::min(kColumnsAtOnce, x.cols - at);
    T* here = scratch->a.Reserve(widest_ * n);
    T* there = scratch->b.Reserve(widest_ * n);
    const auto input = [&](std::size_t i) -> In<T> {
      return i == 0 ? x.Cols(at, n) : In<T>(tape.hidden[i - 1].output.Cols(first + at, n));
    };
    std::size_t layer = activation_.size();
    Mat<T> d(here, affine_[layer - 1].out(), n);
    if (affine_.size() > layer) {
      const Affine& last = affine_.back();
      const In<T> d_last = d_out.Cols(at, n);
      if (gradient != nullptr) last.AddGradient<T>(weights, input(layer), d_last, gradient);
      last.SetTransposed(weights, 0, d_last, d);
    } else {
      Copy<T>(d_out.Cols(at, n), d);
    }
    while (layer-- > 0) {
      activation_[layer].Backward(weights, tape.hidden[layer].Cols(first + at, n), d, gradient);
      const Affine& affine = affine_[layer];
      if (gradient != nullptr) affine.AddGradient<T>(weights, input(layer), d, gradient);
      if (layer > 0) {
        const Mat<T> next(there, affine_[layer - 1].out(), n);
        affine.SetTransposed<T>(weights, 0, d, next);
        std::swap(here, there);
        d = next;
      } else if (d_x) {
        affine.AddTransposed<T>(weights, 0, d, d_x.Cols(at, n));
      }
    }
  }
}

#define DREAMER_INSTANTIATE(T)                                                               \
  template class ParameterGroup<T>;                                                          \
  template void Mlp::Reserve<T>(Index, MlpTape<T>*) const;                                   \
  template void Mlp::Forward<T>(const Weights<T>&, In<T>, Index, MlpTape<T>*, Mat<T>) const; \
  template void Mlp::Backward<T>(const Weights<T>&, In<T>, Index, const MlpTape<T>&, In<T>,  \
                                 MlpScratch<T>*, T*, Mat<T>) const;
DREAMER_INSTANTIATE(float)
DREAMER_INSTANTIATE(double)
#undef DREAMER_INSTANTIATE

}  // namespace dreamsearch::networks
