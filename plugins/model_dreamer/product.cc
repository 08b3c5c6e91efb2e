// Eigen takes its packing buffers from the stack up to this many bytes. With the
// columns cut into blocks below they always fit, so no product allocates.
#define EIGEN_STACK_ALLOCATION_LIMIT (4 << 20)
#define EIGEN_DONT_PARALLELIZE

#include "plugins/model_dreamer/product.h"

#include <Eigen/Core>
#include <algorithm>

namespace dreamsearch::dreamer {
namespace {

constexpr Index kColumnsPerBlock = 512;

template <typename T>
using Dense = Eigen::Matrix<std::remove_const_t<T>, Eigen::Dynamic, Eigen::Dynamic>;
template <typename T>
using Column = Eigen::Matrix<std::remove_const_t<T>, Eigen::Dynamic, 1>;

template <typename T>
using MapOf = Eigen::Map<std::conditional_t<std::is_const_v<T>, const Dense<T>, Dense<T>>, 0,
                         Eigen::OuterStride<>>;

template <typename T>
MapOf<T> AsEigen(Mat<T> m) {
  return MapOf<T>(m.data, m.rows, m.cols, Eigen::OuterStride<>(m.stride));
}
template <typename T>
auto AsColumn(Mat<T> m) {
  return Eigen::Map<std::conditional_t<std::is_const_v<T>, const Column<T>, Column<T>>>(m.data,
                                                                                        m.rows);
}

}  // namespace

template <typename T>
void AddProduct(Mat<const std::type_identity_t<T>> w, Mat<const std::type_identity_t<T>> x,
                Mat<T> y) {
  if (x.cols == 1) {
    AsColumn(y).noalias() += AsEigen(w) * AsColumn(x);
    return;
  }
  for (Index first = 0; first < x.cols; first += kColumnsPerBlock) {
    const Index n = std::min(kColumnsPerBlock, x.cols - first);
    AsEigen(y.Cols(first, n)).noalias() += AsEigen(w) * AsEigen(x.Cols(first, n));
  }
}

template <typename T>
void AddTransposedProduct(Mat<const std::type_identity_t<T>> w,
                          Mat<const std::type_identity_t<T>> dy, Mat<T> dx) {
  for (Index first = 0; first < dy.cols; first += kColumnsPerBlock) {
    const Index n = std::min(kColumnsPerBlock, dy.cols - first);
    AsEigen(dx.Cols(first, n)).noalias() += AsEigen(w).transpose() * AsEigen(dy.Cols(first, n));
  }
}

template <typename T>
void AddOuterProduct(Mat<const std::type_identity_t<T>> dy, Mat<const std::type_identity_t<T>> x,
                     Mat<T> dw) {
  AsEigen(dw).noalias() += AsEigen(dy) * AsEigen(x).transpose();
}

#define DREAMER_INSTANTIATE(T)                                               \
  template void AddProduct<T>(Mat<const T>, Mat<const T>, Mat<T>);           \
  template void AddTransposedProduct<T>(Mat<const T>, Mat<const T>, Mat<T>); \
  template void AddOuterProduct<T>(Mat<const T>, Mat<const T>, Mat<T>);
DREAMER_INSTANTIATE(float)
DREAMER_INSTANTIATE(double)
#undef DREAMER_INSTANTIATE

}  // namespace dreamsearch::dreamer
