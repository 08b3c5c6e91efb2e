// layers.h - layers over one flat array of parameters, with their gradients.
//
// A layer knows where its weights lie in a ParameterGroup and holds no values of
// its own. Forward writes what Backward needs into a tape that the caller owns;
// Backward adds to the group's gradient, or leaves it alone when the group is
// frozen and only the gradient of the input is wanted.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "plugins/networks/bfloat16.h"
#include "plugins/networks/categorical.h"
#include "plugins/networks/elementwise.h"
#include "plugins/networks/matrix.h"
#include "plugins/networks/product.h"

namespace dreamsearch::networks {

// How a tensor gets its first values.
enum class Initial { kZero, kOne, kGlorot, kOrthogonal, kGlorotHundredth, kNormalFiftieth };

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

// The values that a layer computes with, and its weights laid out for products: in T, or
// rounded to bfloat16.
template <typename T>
struct Weights {
  const T* values = nullptr;
  const PackedWeights<T>* packed = nullptr;  // of these values
  const Bfloat16Weights* rounded = nullptr;  // only for T = float; null: products in T
  Bfloat16Scratch* scratch = nullptr;        // of the calling thread, where rounded is set
};

// Who computes products with factors rounded to bfloat16.
struct Rounding {
  bool training = false;
  bool planning = false;
  bool any() const { return training || planning; }
};

// Parameters that one optimiser moves together: values, gradients and Adam's two
// moments, each one contiguous array.
template <typename T>
class ParameterGroup {
 public:
  explicit ParameterGroup(std::string name) : name_(std::move(name)) {}

  // Declares a tensor and returns its offset; before Allocate.
  Index Add(const std::string& name, Index rows, Index cols, Initial initial, Index blocks = 1);

  // Declares columns of a weight that are multiplied on their own and returns the
  // part's number; before Allocate.
  Index AddPart(Index offset, Index rows, Index first, Index cols);

  // Makes the arrays and draws the first values from `seed`.
  void Allocate(std::uint64_t seed, Rounding rounding = {});

  // What to compute with, as training and as planning does. After the values have changed,
  // Pack lays the weights out anew; until then products use the old ones.
  Weights<T> training(Bfloat16Scratch* scratch) const {
    return {values_.data(), packed_.get(), rounding_.training ? rounded_.get() : nullptr, scratch};
  }
  Weights<T> planning(Bfloat16Scratch* scratch) const {
    return {values_.data(), packed_.get(), rounding_.planning ? rounded_.get() : nullptr, scratch};
  }
  // In T, whatever the settings.
  Weights<T> exact() const { return {values_.data(), packed_.get(), nullptr, nullptr}; }
  void Pack();

  const std::string& name() const { return name_; }
  const std::vector<Tensor>& tensors() const { return tensors_; }
  const std::vector<WeightPart>& parts() const { return parts_; }
  Index size() const { return size_; }
  T* values() const { return values_.data(); }
  T* gradient() const { return gradient_.data(); }
  T* first() const { return first_.data(); }
  T* second() const { return second_.data(); }
  void ClearGradient();

 private:
  std::string name_;
  std::vector<Tensor> tensors_;
  std::vector<WeightPart> parts_;
  Index size_ = 0;
  Buffer<T> values_, gradient_, first_, second_;
  Rounding rounding_;
  std::unique_ptr<PackedWeights<T>> packed_;
  std::unique_ptr<Bfloat16Weights> rounded_;
};

// y = W x + b. The input may come in parts, W [x1; x2] = W1 x1 + W2 x2, so that
// what is known for all steps is multiplied once.
class Affine {
 public:
  Affine() = default;
  template <typename T>
  Affine(ParameterGroup<T>* group, const std::string& name, const std::vector<Index>& parts,
         Index out, Initial initial = Initial::kGlorot, Index blocks = 1)
      : out_(out) {
    Index in = 0;
    for (const Index size : parts) in += size;
    weight_ = group->Add(name + ".weight", out, in, initial, blocks);
    bias_ = group->Add(name + ".bias", out, 1, Initial::kZero);
    Index first = 0;
    for (const Index size : parts) {
      parts_.push_back({first, size, group->AddPart(weight_, out, first, size)});
      first += size;
    }
  }

  Index out() const { return out_; }

  // y = b.
  template <typename T>
  void Start(const Weights<T>& weights, Mat<T> y) const {
    FillColumns(weights.values + bias_, y);
  }
  // y += W_part x.
  template <typename T>
  void Add(const Weights<T>& weights, std::size_t part, In<T> x, Mat<T> y) const {
    if constexpr (std::is_same_v<T, float>) {
      if (weights.rounded != nullptr) {
        weights.rounded->AddProduct(parts_[part].number, x, y, weights.scratch);
        return;
      }
    }
    weights.packed->AddProduct(parts_[part].number, x, y);
  }
  // dx += W_part^T dy.
  template <typename T>
  void AddTransposed(const Weights<T>& weights, std::size_t part, In<T> dy, Mat<T> dx) const {
    if constexpr (std::is_same_v<T, float>) {
      if (weights.rounded != nullptr) {
        weights.rounded->AddTransposedProduct(parts_[part].number, dy, dx, weights.scratch);
        return;
      }
    }
    weights.packed->AddTransposedProduct(parts_[part].number, dy, dx);
  }
  // dx = W_part^T dy.
  template <typename T>
  void SetTransposed(const Weights<T>& weights, std::size_t part, In<T> dy, Mat<T> dx) const {
    if constexpr (std::is_same_v<T, float>) {
      if (weights.rounded != nullptr) {
        weights.rounded->SetTransposedProduct(parts_[part].number, dy, dx, weights.scratch);
        return;
      }
    }
    weights.packed->SetTransposedProduct(parts_[part].number, dy, dx);
  }
  // The gradient of W_part += dy x^T.
  template <typename T>
  void AddOuter(const Weights<T>& weights, std::size_t part, In<T> x, In<T> dy, T* gradient) const {
    if constexpr (std::is_same_v<T, float>) {
      if (weights.rounded != nullptr) {
        AddRoundedOuterProduct(dy, x, Part(gradient, part), weights.scratch);
        return;
      }
    }
    AddOuterProduct<T>(dy, x, Part(gradient, part));
  }
  // The gradient of b += the sum of dy's columns.
  template <typename T>
  void AddBias(In<T> dy, T* gradient) const {
    AddColumnSums<T>(dy, gradient + bias_);
  }

  // With the input in one part:
  template <typename T>
  void Forward(const Weights<T>& weights, In<T> x, Mat<T> y) const {
    if constexpr (std::is_same_v<T, float>) {
      if (weights.rounded != nullptr) {
        weights.rounded->SetProduct(parts_[0].number, weights.values + bias_, x, y,
                                    weights.scratch);
        return;
      }
    }
    weights.packed->SetProduct(parts_[0].number, weights.values + bias_, x, y);
  }
  template <typename T>
  void AddGradient(const Weights<T>& weights, In<T> x, In<T> dy, T* gradient) const {
    AddOuter(weights, 0, x, dy, gradient);
    AddBias<T>(dy, gradient);
  }

 private:
  struct InputPart {
    Index first = 0;
    Index size = 0;
    Index number = 0;  // in the group
  };
  template <typename T>
  Mat<T> Part(T* base, std::size_t part) const {
    return {base + weight_ + parts_[part].first * out_, out_, parts_[part].size};
  }

  Index out_ = 0;
  Index weight_ = 0;
  Index bias_ = 0;
  std::vector<InputPart> parts_;
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

// What follows a hidden layer's affine map: elu, or layer normalisation and then elu, mish or
// SimNorm.
enum class Nonlinearity { kElu, kNormElu, kNormMish, kNormSimNorm };

class Activation {
 public:
  Activation() = default;
  template <typename T>
  Activation(ParameterGroup<T>* group, const std::string& name, Index size, Nonlinearity kind)
      : kind_(kind) {
    if (!normalised()) return;
    scale_ = group->Add(name + ".norm_scale", size, 1, Initial::kOne);
    shift_ = group->Add(name + ".norm_shift", size, 1, Initial::kZero);
  }
  template <typename T>
  Activation(ParameterGroup<T>* group, const std::string& name, Index size, bool normalised)
      : Activation(group, name, size, normalised ? Nonlinearity::kNormElu : Nonlinearity::kElu) {}
  bool normalised() const { return kind_ != Nonlinearity::kElu; }

  // The pre-activation is in tape.output, which becomes the output.
  template <typename T>
  void Forward(const Weights<T>& weights, const ActivationTape<T>& tape) const {
    if (!normalised()) return Elu(tape.output);
    LayerNorm(after(), weights.values + scale_, weights.values + shift_, tape.output, tape.unit,
              tape.inverse);
    if (kind_ == Nonlinearity::kNormSimNorm) SimNorm(tape.output);
  }
  // d becomes the gradient of the pre-activation. gradient may be null.
  template <typename T>
  void Backward(const Weights<T>& weights, const ActivationTape<T>& tape, Mat<T> d,
                T* gradient) const {
    if (!normalised()) return EluBackward<T>(tape.output, d);
    if (kind_ == Nonlinearity::kNormSimNorm) SimNormBackward<T>(tape.output, d);
    LayerNormBackward<T>(after(), weights.values + scale_, weights.values + shift_, tape.unit,
                         tape.inverse, tape.output, d,
                         gradient == nullptr ? nullptr : gradient + scale_,
                         gradient == nullptr ? nullptr : gradient + shift_);
  }

 private:
  AfterNorm after() const {
    return kind_ == Nonlinearity::kNormElu    ? AfterNorm::kElu
           : kind_ == Nonlinearity::kNormMish ? AfterNorm::kMish
                                              : AfterNorm::kNothing;
  }

  Nonlinearity kind_ = Nonlinearity::kElu;
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
  Buffer<T> out;  // for who computes the output's gradient
};

struct HiddenLayer {
  Index width = 0;
  Nonlinearity kind = Nonlinearity::kElu;
};

// At least one hidden layer and a linear output; with out = 0 the last hidden layer is the
// output.
class Mlp {
 public:
  Mlp() = default;
  template <typename T>
  Mlp(ParameterGroup<T>* group, const std::string& name, Index in,
      const std::vector<HiddenLayer>& hidden, Index out, Initial weights, Initial last) {
    for (std::size_t i = 0; i < hidden.size(); ++i) {
      const std::string layer = name + "." + std::to_string(i);
      const Index width = hidden[i].width;
      affine_.push_back(Affine(group, layer, {in}, width, weights));
      activation_.emplace_back(group, layer, width, hidden[i].kind);
      widest_ = std::max(widest_, width);
      in = width;
    }
    if (out > 0) affine_.push_back(Affine(group, name + ".out", {in}, out, last));
  }
  // `hidden_layers` layers of `width`.
  template <typename T>
  Mlp(ParameterGroup<T>* group, const std::string& name, Index in, Index width, Index hidden_layers,
      Index out, bool normalised, Initial last = Initial::kGlorot)
      : Mlp(group, name, in,
            std::vector<HiddenLayer>(
                static_cast<std::size_t>(hidden_layers),
                {width, normalised ? Nonlinearity::kNormElu : Nonlinearity::kElu}),
            out, Initial::kGlorot, last) {}
  template <typename T>
  void Reserve(Index columns, MlpTape<T>* tape) const;

  // Uses the tape's columns [first, first + x.cols). `out` is empty for an Mlp
  // without output layer; its output is then Last(tape).
  template <typename T>
  void Forward(const Weights<T>& weights, In<T> x, Index first, MlpTape<T>* tape, Mat<T> out) const;

  template <typename T>
  Mat<T> Last(const MlpTape<T>& tape) const {
    return tape.hidden.back().output;
  }

  // d_out: the gradient of the output, kept. gradient: added to, or null for a
  // frozen group. d_x: added to, or empty.
  template <typename T>
  void Backward(const Weights<T>& weights, In<T> x, Index first, const MlpTape<T>& tape,
                In<T> d_out, MlpScratch<T>* scratch, T* gradient, Mat<T> d_x) const;

 private:
  Index widest_ = 0;
  std::vector<Affine> affine_;
  std::vector<Activation> activation_;
};

}  // namespace dreamsearch::networks
