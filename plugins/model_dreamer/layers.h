// layers.h - layers over one flat array of parameters, with their gradients.
//
// A layer knows where its weights lie in a ParameterGroup and holds no values of
// its own. Forward writes what Backward needs into a tape that the caller owns;
// Backward adds to the group's gradient, or leaves it alone when the group is
// frozen and only the gradient of the input is wanted.
#pragma once

#include <string>
#include <vector>

#include "plugins/model_dreamer/elementwise.h"
#include "plugins/model_dreamer/matrix.h"
#include "plugins/model_dreamer/product.h"

namespace dreamsearch::dreamer {

// How a tensor gets its first values.
enum class Initial { kZero, kOne, kGlorot, kOrthogonal, kGlorotHundredth };

// A named tensor of a group: [rows, cols] at `offset`, column-major. `blocks`
// matrices of rows / blocks rows lie on top of each other (the gates of a GRU)
// and are initialised apart.
struct Tensor {
  std::string name;
  Index rows = 0;
  Index cols = 0;
  Index blocks = 1;
  Index offset = 0;
  Initial initial = Initial::kZero;
};

// Parameters that one optimiser moves together: values, gradients and Adam's two
// moments, each one contiguous array.
template <typename T>
class ParameterGroup {
 public:
  explicit ParameterGroup(std::string name) : name_(std::move(name)) {}

  // Declares a tensor and returns its offset; before Allocate.
  Index Add(const std::string& name, Index rows, Index cols, Initial initial, Index blocks = 1);

  // Makes the arrays and draws the first values from `seed`.
  void Allocate(std::uint64_t seed);

  const std::string& name() const { return name_; }
  const std::vector<Tensor>& tensors() const { return tensors_; }
  Index size() const { return size_; }
  T* values() const { return values_.data(); }
  T* gradient() const { return gradient_.data(); }
  T* first() const { return first_.data(); }
  T* second() const { return second_.data(); }
  void ClearGradient();

 private:
  std::string name_;
  std::vector<Tensor> tensors_;
  Index size_ = 0;
  Buffer<T> values_, gradient_, first_, second_;
};

// y = W x + b, with the weight's columns usable in parts: W [x1; x2] = W1 x1 + W2 x2.
class Affine {
 public:
  Affine() = default;
  template <typename T>
  Affine(ParameterGroup<T>* group, const std::string& name, Index in, Index out,
         Initial initial = Initial::kGlorot, Index blocks = 1)
      : in_(in),
        out_(out),
        weight_(group->Add(name + ".weight", out, in, initial, blocks)),
        bias_(group->Add(name + ".bias", out, 1, Initial::kZero)) {}

  Index in() const { return in_; }
  Index out() const { return out_; }
  template <typename T>
  Mat<T> Weight(T* base) const {
    return {base + weight_, out_, in_};
  }
  template <typename T>
  T* Bias(T* base) const {
    return base + bias_;
  }

  template <typename T>
  void Forward(const T* values, In<T> x, Mat<T> y) const {
    FillColumns(Bias(values), y);
    AddProduct(Weight(values), x, y);
  }
  template <typename T>
  void AddGradient(In<T> x, Mat<T> dy, T* gradient) const {
    AddOuterProduct<T>(dy, x, Weight(gradient));
    AddColumnSums<T>(dy, Bias(gradient));
  }

 private:
  Index in_ = 0;
  Index out_ = 0;
  Index weight_ = 0;
  Index bias_ = 0;
};

// What a hidden layer's activation keeps: the output, and with layer
// normalisation the normalised input and its inverse deviation.
template <typename T>
struct ActivationTape {
  Mat<T> output;   // [U, n]
  Mat<T> unit;     // [U, n] or empty
  Mat<T> inverse;  // [1, n] or empty

  ActivationTape Cols(Index first, Index count) const {
    if (!unit) return {output.Cols(first, count), {}, {}};
    return {output.Cols(first, count), unit.Cols(first, count), inverse.Cols(first, count)};
  }
};

// The memory of one activation tape.
template <typename T>
struct ActivationBuffers {
  Buffer<T> output, unit, inverse;
  ActivationTape<T> Shape(Index rows, Index cols, bool normalised) {
    ActivationTape<T> tape;
    tape.output = output.Shape(rows, cols);
    if (normalised) {
      tape.unit = unit.Shape(rows, cols);
      tape.inverse = inverse.Shape(1, cols);
    }
    return tape;
  }
};

// elu(x), or elu(LayerNorm(x)).
class Activation {
 public:
  Activation() = default;
  template <typename T>
  Activation(ParameterGroup<T>* group, const std::string& name, Index size, bool normalised)
      : normalised_(normalised) {
    if (!normalised_) return;
    scale_ = group->Add(name + ".norm_scale", size, 1, Initial::kOne);
    shift_ = group->Add(name + ".norm_shift", size, 1, Initial::kZero);
  }
  bool normalised() const { return normalised_; }

  // The pre-activation is in tape.output, which becomes the output.
  template <typename T>
  void Forward(const T* values, const ActivationTape<T>& tape) const {
    if (normalised_) {
      LayerNorm(values + scale_, values + shift_, tape.output, tape.unit, tape.inverse);
    }
    Elu(tape.output);
  }
  // d becomes the gradient of the pre-activation. gradient may be null.
  template <typename T>
  void Backward(const T* values, const ActivationTape<T>& tape, Mat<T> d, T* gradient) const {
    EluBackward<T>(tape.output, d);
    if (normalised_) {
      LayerNormBackward<T>(values + scale_, tape.unit, tape.inverse, d,
                           gradient == nullptr ? nullptr : gradient + scale_,
                           gradient == nullptr ? nullptr : gradient + shift_);
    }
  }

 private:
  bool normalised_ = false;
  Index scale_ = 0;
  Index shift_ = 0;
};

// The hidden activations of an Mlp for up to `columns` samples.
template <typename T>
struct MlpTape {
  std::vector<ActivationTape<T>> hidden;
  std::vector<ActivationBuffers<T>> buffers;
};

// Gradients on their way back through an Mlp; one is enough for all of them.
template <typename T>
struct MlpScratch {
  Buffer<T> a, b;
};

// `hidden_layers` layers of `width` and a linear output; with out = 0 the last
// hidden layer is the output.
class Mlp {
 public:
  Mlp() = default;
  template <typename T>
  Mlp(ParameterGroup<T>* group, const std::string& name, Index in, Index width, Index hidden_layers,
      Index out, bool normalised, Initial last = Initial::kGlorot)
      : width_(width), normalised_(normalised) {
    for (Index i = 0; i < hidden_layers; ++i) {
      const std::string layer = name + "." + std::to_string(i);
      affine_.emplace_back(group, layer, i == 0 ? in : width, width);
      activation_.emplace_back(group, layer, width, normalised);
    }
    if (out > 0) {
      affine_.emplace_back(group, name + ".out", hidden_layers == 0 ? in : width, out, last);
    }
  }
  Index layers() const { return static_cast<Index>(activation_.size()); }
  Index in() const { return affine_.front().in(); }
  const std::vector<Affine>& affine() const { return affine_; }

  template <typename T>
  void Reserve(Index columns, MlpTape<T>* tape) const;

  // Uses the tape's columns [first, first + x.cols). `out` is empty for an Mlp
  // without output layer; its output is then Last(tape).
  template <typename T>
  void Forward(const T* values, In<T> x, Index first, MlpTape<T>* tape, Mat<T> out) const;

  template <typename T>
  Mat<T> Last(const MlpTape<T>& tape) const {
    return tape.hidden.back().output;
  }

  // d_out: the gradient of the output, kept. gradient: added to, or null for a
  // frozen group. d_x: added to, or empty.
  template <typename T>
  void Backward(const T* values, In<T> x, Index first, const MlpTape<T>& tape, In<T> d_out,
                MlpScratch<T>* scratch, T* gradient, Mat<T> d_x) const;

 private:
  Index width_ = 0;
  bool normalised_ = false;
  std::vector<Affine> affine_;
  std::vector<Activation> activation_;
};

}  // namespace dreamsearch::dreamer
