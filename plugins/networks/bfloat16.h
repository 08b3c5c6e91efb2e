// bfloat16.h - products with bfloat16 factors and float sums, by the processor's
// AVX-512 BF16 instructions or its tile unit (AMX).
//
// A factor is rounded to the nearest bfloat16 (8 bits of significand, a relative
// error of at most 2^-9), products are exact, sums are float. Weights stay float
// elsewhere; here are rounded copies of them, laid out for the products and
// remade after every change. Only where Bfloat16Available().
#pragma once

#include <cstdint>
#include <vector>

#include "dreamsearch/instruction_set.h"
#include "plugins/networks/matrix.h"
#include "plugins/networks/product.h"

namespace dreamsearch::networks {

// Whether the chosen instruction set multiplies bfloat16.
inline bool Bfloat16Available() { return ChosenInstructionSet() >= InstructionSet::kAvx512Bf16; }

inline constexpr Index kBiasOverrun = 16;

// Memory for the rounded samples of a product: one product at a time.
struct Bfloat16Scratch {
  Buffer<std::uint16_t> left, right;
};

// Rounded copies of a group's weights. Several threads may multiply by them, each with
// a scratch of its own.
class Bfloat16Weights {
 public:
  explicit Bfloat16Weights(const std::vector<WeightPart>& parts);

  // Takes the weights of the group's values.
  void Pack(const float* values);

  // y += w x and dx += w^T dy, with w the part.
  void AddProduct(Index part, Mat<const float> x, Mat<float> y, Bfloat16Scratch* scratch) const;
  void AddTransposedProduct(Index part, Mat<const float> dy, Mat<float> dx,
                            Bfloat16Scratch* scratch) const;
  // y = w x + bias and dx = w^T dy. The bias may be read up to kBiasOverrun values
  // beyond its end.
  void SetProduct(Index part, const float* bias, Mat<const float> x, Mat<float> y,
                  Bfloat16Scratch* scratch) const;
  void SetTransposedProduct(Index part, Mat<const float> dy, Mat<float> dx,
                            Bfloat16Scratch* scratch) const;

 private:
  struct Packed {
    WeightPart part;
    Index forward = 0;     // where the tiles of w begin
    Index transposed = 0;  // and those of w^T
  };
  std::vector<Packed> parts_;
  Buffer<std::uint16_t> tiles_;
};

// dw += dy x^T, both factors rounded.
void AddRoundedOuterProduct(Mat<const float> dy, Mat<const float> x, Mat<float> dw,
                            Bfloat16Scratch* scratch);

}  // namespace dreamsearch::networks
