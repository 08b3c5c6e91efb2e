#include "plugins/networks/product.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "plugins/networks/product.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "plugins/networks/dispatch.h"
#include "plugins/networks/vector-inl.h"

#ifndef DREAMSEARCH_NETWORKS_PRODUCT_KERNELS
#define DREAMSEARCH_NETWORKS_PRODUCT_KERNELS
namespace dreamsearch::networks {

// The kernels of one instruction set.
template <typename T>
struct ProductKernels {
  Index lanes;  // outputs in a panel

  // panels: [blocks of rows][cols][lanes], zero beyond the rows.
  void (*pack)(Mat<const T> w, T* panels);
  void (*pack_transposed)(Mat<const T> w, T* panels);
  // y[:, j] = start + j * start_stride + sum over k of panels[:, k] x[k, j]; from zero where
  // start is null. y may be what `start` points to.
  void (*multiply)(const T* panels, const T* start, Index start_stride, Mat<const T> x, Mat<T> y);
  void (*add_outer)(Mat<const T> dy, Mat<const T> x, Mat<T> dw);
};

}  // namespace dreamsearch::networks
#endif

HWY_BEFORE_NAMESPACE();
namespace dreamsearch::networks {
namespace HWY_NAMESPACE {

#if HWY_TARGET == HWY_AVX3
constexpr int kRegisters = 32;
constexpr int kColumnsPerTile = 6;
#else
constexpr int kRegisters = 16;
constexpr int kColumnsPerTile = 4;
#endif

// Panels taken together with `columns` columns: enough sums to keep the multipliers
// busy, and few enough for the registers.
constexpr int PanelsPerTile(int columns) {
  if (columns == 1) return 8;
  if (kRegisters == 32) return columns == 2 ? 8 : 4;
  return columns <= 3 ? 4 : 3;
}

// Columns whose inputs stay in the first-level cache while all panels pass by.
constexpr Index kColumnsPerBlock = 24;
// Samples of an outer product whose panels stay there.
constexpr Index kSamplesPerBlock = 128;

// Where a tile's second factor lies: entry (k, c) at data + k * along + c * across. In a
// product along is 1, in an outer product across is.
template <typename T>
struct Factor {
  const T* data;
  Index along;
  Index across;
};

// C columns of P panels. y's first row is the first panel's; `rows` of them are left.
template <int P, int C, bool kOuter, typename T>
void MultiplyTile(const T* panels, Index depth, const T* start, Index start_stride, Factor<T> x,
                  T* y, Index y_stride, Index rows) {
  const hn::ScalableTag<T> d;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  hn::Vec<decltype(d)> sum[P][C];
#pragma GCC unroll 8
  for (int p = 0; p < P; ++p) {
#pragma GCC unroll 8
    for (int c = 0; c < C; ++c) {
      sum[p][c] = start == nullptr
                      ? hn::Zero(d)
                      : LoadUpTo(d, start + c * start_stride + p * lanes, rows - p * lanes);
    }
  }
  const T* panel[P];
#pragma GCC unroll 8
  for (int p = 0; p < P; ++p) panel[p] = panels + p * depth * lanes;
  const T* column[C];
#pragma GCC unroll 8
  for (int c = 0; c < C; ++c) column[c] = x.data + c * (kOuter ? 1 : x.across);
  for (Index k = 0; k < depth; ++k) {
    hn::Vec<decltype(d)> w[P];
#pragma GCC unroll 8
    for (int p = 0; p < P; ++p) w[p] = hn::Load(d, panel[p] + k * lanes);
#pragma GCC unroll 8
    for (int c = 0; c < C; ++c) {
      const auto factor = hn::Set(d, column[c][kOuter ? k * x.along : k]);
#pragma GCC unroll 8
      for (int p = 0; p < P; ++p) sum[p][c] = hn::MulAdd(w[p], factor, sum[p][c]);
    }
  }
#pragma GCC unroll 8
  for (int p = 0; p < P; ++p) {
#pragma GCC unroll 8
    for (int c = 0; c < C; ++c) {
      StoreUpTo(sum[p][c], d, y + c * y_stride + p * lanes, rows - p * lanes);
    }
  }
}

// `tiles` times C columns of `groups` times `size` panels.
template <int C, bool kOuter, typename T, int P = PanelsPerTile(C)>
void MultiplyGroups(Index size, Index groups, const T* panels, Index depth, const T* start,
                    Index start_stride, Factor<T> x, Mat<T> y, Index tiles) {
  if constexpr (P > 1) {
    if (size < P) {
      MultiplyGroups<C, kOuter, T, P - 1>(size, groups, panels, depth, start, start_stride, x, y,
                                          tiles);
      return;
    }
  }
  const hn::ScalableTag<T> d;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  for (Index group = 0; group < groups; ++group) {
    const Index row = group * P * lanes;
    for (Index tile = 0; tile < tiles; ++tile) {
      const Index first = tile * C;
      MultiplyTile<P, C, kOuter>(panels + row * depth, depth,
                                 start == nullptr ? nullptr : start + first * start_stride + row,
                                 start_stride,
                                 Factor<T>{x.data + first * x.across, x.along, x.across},
                                 y.col(first) + row, y.stride, y.rows - row);
    }
  }
}

// `tiles` times C columns of all panels, in groups of nearly equal size.
template <int C, bool kOuter, typename T>
void MultiplyPanels(const T* panels, Index count, Index depth, const T* start, Index start_stride,
                    Factor<T> x, Mat<T> y, Index tiles) {
  const hn::ScalableTag<T> d;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  const Index groups = (count + PanelsPerTile(C) - 1) / PanelsPerTile(C);
  const Index narrow = count / groups;  // panels of a narrow group
  const Index wide_groups = count % groups;
  MultiplyGroups<C, kOuter>(narrow + 1, wide_groups, panels, depth, start, start_stride, x, y,
                            tiles);
  const Index row = wide_groups * (narrow + 1) * lanes;
  MultiplyGroups<C, kOuter>(narrow, groups - wide_groups, panels + row * depth, depth,
                            start == nullptr ? nullptr : start + row, start_stride, x,
                            y.Rows(row, y.rows - row), tiles);
}

template <int C, bool kOuter, typename T>
void MultiplyColumns(int columns, const T* panels, Index count, Index depth, const T* start,
                     Index start_stride, Factor<T> x, Mat<T> y, Index tiles) {
  if (columns == C) {
    MultiplyPanels<C, kOuter>(panels, count, depth, start, start_stride, x, y, tiles);
    return;
  }
  if constexpr (C > 1) {
    MultiplyColumns<C - 1, kOuter>(columns, panels, count, depth, start, start_stride, x, y, tiles);
  }
}

// All columns of y, in tiles of nearly equal width.
template <bool kOuter, typename T>
void MultiplyAll(const T* panels, Index count, Index depth, const T* start, Index start_stride,
                 Factor<T> x, Mat<T> y) {
  const Index tiles = (y.cols + kColumnsPerTile - 1) / kColumnsPerTile;
  const Index narrow = y.cols / tiles;      // columns of a narrow tile
  const Index wide_tiles = y.cols % tiles;  // with one more
  Index first = 0;
  const auto run = [&](Index columns, Index n) {
    if (n == 0) return;
    MultiplyColumns<kColumnsPerTile, kOuter>(
        static_cast<int>(columns), panels, count, depth,
        start == nullptr ? nullptr : start + first * start_stride, start_stride,
        Factor<T>{x.data + first * x.across, x.along, x.across}, y.Cols(first, columns * n), n);
    first += columns * n;
  };
  run(narrow + 1, wide_tiles);
  run(narrow, tiles - wide_tiles);
}

template <typename T>
void Multiply(const T* panels, const T* start, Index start_stride, Mat<const T> x, Mat<T> y) {
  const hn::ScalableTag<T> d;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  const Index count = (y.rows + lanes - 1) / lanes;
  for (Index first = 0; first < y.cols; first += kColumnsPerBlock) {
    const Index n = std::min(kColumnsPerBlock, y.cols - first);
    MultiplyAll<false>(panels, count, x.rows,
                       start == nullptr ? nullptr : start + first * start_stride, start_stride,
                       Factor<T>{x.col(first), 1, x.stride}, y.Cols(first, n));
  }
}

template <typename T>
void Pack(Mat<const T> w, T* panels) {
  const hn::ScalableTag<T> d;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  for (Index i = 0; i < w.rows; i += lanes) {
    for (Index k = 0; k < w.cols; ++k, panels += lanes) {
      hn::Store(LoadUpTo(d, w.col(k) + i, w.rows - i), d, panels);
    }
  }
}

template <typename T>
void PackTransposed(Mat<const T> w, T* panels) {
  const hn::ScalableTag<T> d;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  for (Index i = 0; i < w.cols; i += lanes, panels += w.rows * lanes) {
    for (Index l = 0; l < lanes; ++l) {
      if (i + l >= w.cols) {
        for (Index k = 0; k < w.rows; ++k) panels[k * lanes + l] = T(0);
        continue;
      }
      const T* column = w.col(i + l);
      for (Index k = 0; k < w.rows; ++k) panels[k * lanes + l] = column[k];
    }
  }
}

template <typename T>
void AddOuter(Mat<const T> dy, Mat<const T> x, Mat<T> dw) {
  const hn::ScalableTag<T> d;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  constexpr int kPanels = PanelsPerTile(kColumnsPerTile);
  HWY_ALIGN T panels[kPanels * kSamplesPerBlock * HWY_MAX_BYTES / sizeof(T)];
  for (Index first = 0; first < x.cols; first += kSamplesPerBlock) {
    const Index depth = std::min(kSamplesPerBlock, x.cols - first);
    for (Index i = 0; i < dw.rows; i += kPanels * lanes) {
      const Index rows = std::min(kPanels * lanes, dw.rows - i);
      Pack<T>(dy.Cols(first, depth).Rows(i, rows), panels);
      const Mat<T> sums = dw.Rows(i, rows);
      MultiplyAll<true>(panels, (rows + lanes - 1) / lanes, depth, sums.data, sums.stride,
                        Factor<T>{x.col(first), x.stride, 1}, sums);
    }
  }
}

template <typename T>
const ProductKernels<T>& KernelsOf() {
  static constexpr ProductKernels<T> kernels = {static_cast<Index>(HWY_LANES(T)), &Pack<T>,
                                                &PackTransposed<T>, &Multiply<T>, &AddOuter<T>};
  return kernels;
}

}  // namespace HWY_NAMESPACE
}  // namespace dreamsearch::networks
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dreamsearch::networks {
DREAMSEARCH_CHOSEN_KERNELS(ProductKernels)

template <typename T>
PackedWeights<T>::PackedWeights(const std::vector<WeightPart>& parts) {
  const Index lanes = Kernels<T>().lanes;
  const auto panels = [lanes](Index rows, Index depth) {
    return (rows + lanes - 1) / lanes * lanes * depth;
  };
  Index size = 0;
  for (const WeightPart& part : parts) {
    Packed packed;
    packed.part = part;
    packed.forward = size;
    size += panels(part.rows, part.cols);
    packed.transposed = size;
    size += panels(part.cols, part.rows);
    parts_.push_back(packed);
  }
  panels_.Reserve(size);
}

template <typename T>
void PackedWeights<T>::Pack(const T* values) {
  for (const Packed& packed : parts_) {
    const WeightPart& part = packed.part;
    const Mat<const T> w(values + part.offset + part.first * part.rows, part.rows, part.cols);
    Kernels<T>().pack(w, panels_.data() + packed.forward);
    Kernels<T>().pack_transposed(w, panels_.data() + packed.transposed);
  }
}

template <typename T>
void PackedWeights<T>::AddProduct(Index part, Mat<const T> x, Mat<T> y) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  Kernels<T>().multiply(panels_.data() + packed.forward, y.data, y.stride, x, y);
}

template <typename T>
void PackedWeights<T>::SetProduct(Index part, const T* bias, Mat<const T> x, Mat<T> y) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  Kernels<T>().multiply(panels_.data() + packed.forward, bias, 0, x, y);
}

template <typename T>
void PackedWeights<T>::AddTransposedProduct(Index part, Mat<const T> dy, Mat<T> dx) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  Kernels<T>().multiply(panels_.data() + packed.transposed, dx.data, dx.stride, dy, dx);
}

template <typename T>
void PackedWeights<T>::SetTransposedProduct(Index part, Mat<const T> dy, Mat<T> dx) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  Kernels<T>().multiply(panels_.data() + packed.transposed, nullptr, 0, dy, dx);
}

template <typename T>
void AddOuterProduct(Mat<const std::type_identity_t<T>> dy, Mat<const std::type_identity_t<T>> x,
                     Mat<T> dw) {
  Kernels<T>().add_outer(dy, x, dw);
}

template class PackedWeights<float>;
template class PackedWeights<double>;
template void AddOuterProduct<float>(Mat<const float>, Mat<const float>, Mat<float>);
template void AddOuterProduct<double>(Mat<const double>, Mat<const double>, Mat<double>);

}  // namespace dreamsearch::networks
#endif  // HWY_ONCE
