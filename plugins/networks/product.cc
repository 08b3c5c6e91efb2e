#include "plugins/networks/product.h"

#include <Eigen/Core>
#include <algorithm>

#ifdef __AVX512F__
#include <immintrin.h>
#endif

namespace dreamsearch::networks {
namespace {

// Eigen takes a packing buffer from the stack if it is small enough (CMakeLists.txt says
// up to where); with the samples cut into blocks those of layers up to some 400 wide are.
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

#ifdef __AVX512F__

// Eigen copies its factors into an order that pays when they are used often. With few
// columns, as planners have them, it is faster to read the weight where it lies: once
// for every six columns, whose sums stay in registers. A column's bits do not depend on
// its place here, which they do in Eigen's kernels.
constexpr Index kFewColumns = 64;
constexpr Index kLanes = 16;   // floats in a register
constexpr int kRegisters = 4;  // of rows at a time
constexpr int kColumns = 6;

// y += w x for V registers of rows, the last one under `tail`, and C columns.
template <int V, int C>
inline void AddBlock(Mat<const float> w, Mat<const float> x, Mat<float> y, __mmask16 tail) {
  const auto mask = [tail](int v) { return v + 1 == V ? tail : __mmask16{0xffff}; };
  __m512 sum[V][C];
#pragma GCC unroll 8
  for (int j = 0; j < C; ++j) {
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) sum[v][j] = _mm512_maskz_loadu_ps(mask(v), y.col(j) + kLanes * v);
  }
  for (Index k = 0; k < x.rows; ++k) {
    __m512 weight[V];
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) weight[v] = _mm512_maskz_loadu_ps(mask(v), w.col(k) + kLanes * v);
#pragma GCC unroll 8
    for (int j = 0; j < C; ++j) {
      const __m512 factor = _mm512_set1_ps(x(k, j));
#pragma GCC unroll 8
      for (int v = 0; v < V; ++v) sum[v][j] = _mm512_fmadd_ps(weight[v], factor, sum[v][j]);
    }
  }
#pragma GCC unroll 8
  for (int j = 0; j < C; ++j) {
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) {
      _mm512_mask_storeu_ps(y.col(j) + kLanes * v, mask(v), sum[v][j]);
    }
  }
}

template <int V, int C = kColumns>
void AddBlocks(Mat<const float> w, Mat<const float> x, Mat<float> y, __mmask16 tail) {
  Index first = 0;
  for (; first + C <= x.cols; first += C) {
    AddBlock<V, C>(w, x.Cols(first, C), y.Cols(first, C), tail);
  }
  if constexpr (C > 1) {
    const Index left = x.cols - first;
    if (left > 0) AddBlocks<V, C - 1>(w, x.Cols(first, left), y.Cols(first, left), tail);
  }
}

void AddFewColumns(Mat<const float> w, Mat<const float> x, Mat<float> y) {
  for (Index first = 0; first < w.rows; first += kRegisters * kLanes) {
    const Index rows = std::min<Index>(kRegisters * kLanes, w.rows - first);
    const Index registers = (rows + kLanes - 1) / kLanes;
    const auto tail = static_cast<__mmask16>((1u << (rows - (registers - 1) * kLanes)) - 1);
    const Mat<const float> part = w.Rows(first, rows);
    const Mat<float> sums = y.Rows(first, rows);
    switch (registers) {
      case 4:
        AddBlocks<4>(part, x, sums, tail);
        break;
      case 3:
        AddBlocks<3>(part, x, sums, tail);
        break;
      case 2:
        AddBlocks<2>(part, x, sums, tail);
        break;
      default:
        AddBlocks<1>(part, x, sums, tail);
    }
  }
}

bool FewColumns(Mat<const float> w, Mat<const float> x) {
  return x.cols > 1 && x.cols <= kFewColumns && w.rows > 1;
}

#endif

}  // namespace

template <typename T>
void AddProduct(Mat<const std::type_identity_t<T>> w, Mat<const std::type_identity_t<T>> x,
                Mat<T> y) {
  if (x.cols == 1) {
    AsColumn(y).noalias() += AsEigen(w) * AsColumn(x);
    return;
  }
#ifdef __AVX512F__
  if constexpr (std::is_same_v<T, float>) {
    if (FewColumns(w, x)) return AddFewColumns(w, x, y);
  }
#endif
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
  for (Index first = 0; first < x.cols; first += kColumnsPerBlock) {
    const Index n = std::min(kColumnsPerBlock, x.cols - first);
    AsEigen(dw).noalias() += AsEigen(dy.Cols(first, n)) * AsEigen(x.Cols(first, n)).transpose();
  }
}

#define DREAMER_INSTANTIATE(T)                                               \
  template void AddProduct<T>(Mat<const T>, Mat<const T>, Mat<T>);           \
  template void AddTransposedProduct<T>(Mat<const T>, Mat<const T>, Mat<T>); \
  template void AddOuterProduct<T>(Mat<const T>, Mat<const T>, Mat<T>);
DREAMER_INSTANTIATE(float)
DREAMER_INSTANTIATE(double)
#undef DREAMER_INSTANTIATE

}  // namespace dreamsearch::networks
