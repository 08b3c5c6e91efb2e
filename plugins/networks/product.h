// product.h - the three matrix products of a layer, the only place that knows
// how they are computed.
//
// Nothing is allocated for layers up to some 400 wide. Results do not depend on the number of threads; the last
// bits depend on the instruction set and on the number of columns.
#pragma once

#include <type_traits>

#include "plugins/networks/matrix.h"

namespace dreamsearch::networks {

// y += w x. w: [out, in], x: [in, n], y: [out, n].
template <typename T>
void AddProduct(Mat<const std::type_identity_t<T>> w, Mat<const std::type_identity_t<T>> x,
                Mat<T> y);

// dx += w^T dy. w: [out, in], dy: [out, n], dx: [in, n].
template <typename T>
void AddTransposedProduct(Mat<const std::type_identity_t<T>> w,
                          Mat<const std::type_identity_t<T>> dy, Mat<T> dx);

// dw += dy x^T. dy: [out, n], x: [in, n], dw: [out, in].
template <typename T>
void AddOuterProduct(Mat<const std::type_identity_t<T>> dy, Mat<const std::type_identity_t<T>> x,
                     Mat<T> dw);

}  // namespace dreamsearch::networks
