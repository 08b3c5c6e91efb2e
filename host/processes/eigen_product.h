// eigen_product.h - a large product by Eigen: what a core of this machine can do.
//
// Eigen is compiled once for each instruction set, so that the product uses the one in use.
#pragma once

#include <cstdint>

namespace dreamsearch {

// c = a b of column-major matrices: c [m, n], a [m, k], b [k, n]; on one thread.
using EigenProduct = void (*)(const float* a, const float* b, float* c, std::int64_t m,
                              std::int64_t n, std::int64_t k);
// That of the instruction set in use.
EigenProduct ChosenEigenProduct();

// GFLOP a processor second of the best of six products of 512 x 512 x 512; some 20 ms.
double MeasureGflopPerSecond();

}  // namespace dreamsearch
