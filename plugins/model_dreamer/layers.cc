#include "plugins/model_dreamer/layers.h"

#include <cmath>

#include "dreamsearch/random.h"

namespace dreamsearch::dreamer {
namespace {

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
void ParameterGroup<T>::Allocate(std::uint64_t seed) {
  values_.Reserve(size_);
  gradient_.Reserve(size_);
  first_.Reserve(size_);
  second_.Reserve(size_);
  for (std::size_t i = 0; i < tensors_.size(); ++i) {
    Initialise(tensors_[i], DeriveSeed(seed, i), values_.data() + tensors_[i].offset);
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
    tape->hidden[i] = tape->buffers[i].Shape(width_, columns, normalised_);
  }
}

template <typename T>
void Mlp::Forward(const T* values, In<T> x, Index first, MlpTape<T>* tape, Mat<T> out) const {
  In<T> input = x;
  for (std::size_t i = 0; i < activation_.size(); ++i) {
    const ActivationTape<T> hidden = tape->hidden[i].Cols(first, x.cols);
    affine_[i].Forward(values, input, hidden.output);
    activation_[i].Forward(values, hidden);
    input = hidden.output;
  }
  if (affine_.size() > activation_.size()) affine_.back().Forward(values, input, out);
}

template <typename T>
void Mlp::Backward(const T* values, In<T> x, Index first, const MlpTape<T>& tape, In<T> d_out,
                   MlpScratch<T>* scratch, T* gradient, Mat<T> d_x) const {
  const Index n = x.cols;
  Mat<T> d = scratch->a.Shape(width_, n);
  Mat<T> next = scratch->b.Shape(width_, n);
  std::size_t layer = activation_.size();
  const auto input = [&](std::size_t i) -> In<T> {
    return i == 0 ? x : In<T>(tape.hidden[i - 1].output.Cols(first, n));
  };
  if (affine_.size() > layer) {
    const Affine& last = affine_.back();
    if (gradient != nullptr) {
      AddOuterProduct<T>(d_out, input(layer), last.Weight(gradient));
      AddColumnSums<T>(d_out, last.Bias(gradient));
    }
    if (layer == 0) {
      if (d_x) AddTransposedProduct<T>(last.Weight(values), d_out, d_x);
      return;
    }
    SetZero(d);
    AddTransposedProduct<T>(last.Weight(values), d_out, d);
  } else {
    Copy<T>(d_out, d);
  }
  while (layer-- > 0) {
    activation_[layer].Backward(values, tape.hidden[layer].Cols(first, n), d, gradient);
    const Affine& affine = affine_[layer];
    if (gradient != nullptr) affine.AddGradient<T>(input(layer), d, gradient);
    if (layer > 0) {
      SetZero(next);
      AddTransposedProduct<T>(affine.Weight(values), d, next);
      std::swap(d, next);
    } else if (d_x) {
      AddTransposedProduct<T>(affine.Weight(values), d, d_x);
    }
  }
}

#define DREAMER_INSTANTIATE(T)                                                                     \
  template class ParameterGroup<T>;                                                                \
  template void Mlp::Reserve<T>(Index, MlpTape<T>*) const;                                         \
  template void Mlp::Forward<T>(const T*, In<T>, Index, MlpTape<T>*, Mat<T>) const;                \
  template void Mlp::Backward<T>(const T*, In<T>, Index, const MlpTape<T>&, In<T>, MlpScratch<T>*, \
                                 T*, Mat<T>) const;
DREAMER_INSTANTIATE(float)
DREAMER_INSTANTIATE(double)
#undef DREAMER_INSTANTIATE

}  // namespace dreamsearch::dreamer
