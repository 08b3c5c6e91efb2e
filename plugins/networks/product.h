// product.h - the matrix products of a layer, the only place that knows how they are
// computed.
//
// Weights are multiplied many times before they change, so they are laid out anew after
// every change, in the order in which the kernels read them: a *panel* holds as many
// outputs as fit a vector register, for all inputs. A kernel keeps the sums of some panels
// and some columns in registers and adds one product after the other, in the order of the
// inputs.
//
// Bits     an entry of a product has the same bits whatever columns stand beside it and
//          wherever they stand; they depend on the instruction set and on nothing else.
// Memory   nothing is allocated but by the constructor.
// Threads  several may multiply by the same weights.
#pragma once

#include <type_traits>
#include <vector>

#include "plugins/networks/matrix.h"

namespace dreamsearch::networks {

// The columns [first, first + cols) of a weight [rows, *] at `offset` of a group.
struct WeightPart {
  Index offset = 0;
  Index rows = 0;
  Index first = 0;
  Index cols = 0;
};

// A group's weights w [out, in], part by part, laid out for products with them.
template <typename T>
class PackedWeights {
 public:
  explicit PackedWeights(const std::vector<WeightPart>& parts);

  // Takes the weights of the group's values.
  void Pack(const T* values);

  // y += w x and dx += w^T dy, with w the part. x: [in, n], y: [out, n].
  void AddProduct(Index part, Mat<const T> x, Mat<T> y) const;
  void AddTransposedProduct(Index part, Mat<const T> dy, Mat<T> dx) const;
  // y = w x + bias and dx = w^T dy. bias: [out].
  void SetProduct(Index part, const T* bias, Mat<const T> x, Mat<T> y) const;
  void SetTransposedProduct(Index part, Mat<const T> dy, Mat<T> dx) const;

 private:
  struct Packed {
    WeightPart part;
    Index forward = 0;     // where the panels of w begin
    Index transposed = 0;  // and those of w^T
  };
  std::vector<Packed> parts_;
  Buffer<T> panels_;
};

// dw += dy x^T. dy: [out, n], x: [in, n], dw: [out, in].
template <typename T>
void AddOuterProduct(Mat<const std::type_identity_t<T>> dy, Mat<const std::type_identity_t<T>> x,
                     Mat<T> dw);

}  // namespace dreamsearch::networks
