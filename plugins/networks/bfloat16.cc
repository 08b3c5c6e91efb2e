// Over 400 lines: the tile unit (AMX) and AVX-512 BF16 multiply the same tiles, packed by the same
// functions.
#include "plugins/networks/bfloat16.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

// The tile unit multiplies a left tile, 16 rows of 32 factors, by a right tile, 32 rows
// of 16, stored as 16 rows of pairs, and adds to a tile of 16 x 16 floats. With
// samples as rows, a product of column-major matrices is
//
//   y^T [n, out] += x^T [n, in] w^T [in, out]
//
// and every float tile is a block of a column-major matrix. Tiles are stored one
// after another, zero beyond the edges: left and right [block][k block][512]. A vector
// of 16 sums, to which one instruction adds the products of 16 pairs, reads the same tiles.

namespace dreamsearch::networks {

#if defined(__x86_64__)

#define PAIR_TARGET __attribute__((target("avx512f,avx512bw,avx512vl,avx512dq,avx512bf16")))
#define TILE_TARGET \
  __attribute__((target("avx512f,avx512bw,avx512vl,avx512dq,avx512bf16,amx-tile,amx-bf16")))

namespace {

constexpr Index kRows = 16;              // rows of a left tile, columns of a right one
constexpr Index kDepth = 32;             // factors summed by one tile product
constexpr Index kTile = kRows * kDepth;  // factors in a tile
constexpr Index kSamplesPerChunk = 256;  // of an outer product, packed at once

Index Blocks(Index size, Index block) { return (size + block - 1) / block; }

struct alignas(64) TileConfig {
  std::uint8_t palette = 1;
  std::uint8_t start_row = 0;
  std::uint8_t reserved[14] = {};
  std::uint16_t bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
  std::uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
};
constexpr TileConfig kConfig;

// Tile registers hold their shape until released.
TILE_TARGET inline void BeginTiles() { _tile_loadconfig(&kConfig); }
TILE_TARGET inline void EndTiles() { _tile_release(); }

PAIR_TARGET inline __mmask16 Mask(Index count) {
  return static_cast<__mmask16>(count >= 16 ? 0xffff : (1u << (count < 0 ? 0 : count)) - 1);
}

// Two vectors of floats as bfloat16: a's first, then b's.
PAIR_TARGET inline __m512i Round(__m512 a, __m512 b) {
  return reinterpret_cast<__m512i>(_mm512_cvtne2ps_pbh(b, a));
}

// The transpose of a 16 x 16 matrix of 32-bit values, in registers.
PAIR_TARGET inline void Transpose(__m512i* m) {
  __m512i t[16];
  for (int i = 0; i < 16; i += 2) {
    t[i] = _mm512_unpacklo_epi32(m[i], m[i + 1]);
    t[i + 1] = _mm512_unpackhi_epi32(m[i], m[i + 1]);
  }
  for (int i = 0; i < 16; i += 4) {
    m[i] = _mm512_unpacklo_epi64(t[i], t[i + 2]);
    m[i + 1] = _mm512_unpackhi_epi64(t[i], t[i + 2]);
    m[i + 2] = _mm512_unpacklo_epi64(t[i + 1], t[i + 3]);
    m[i + 3] = _mm512_unpackhi_epi64(t[i + 1], t[i + 3]);
  }
  for (int i = 0; i < 4; ++i) {
    t[i] = _mm512_shuffle_i32x4(m[i], m[i + 4], 0x88);
    t[i + 4] = _mm512_shuffle_i32x4(m[i], m[i + 4], 0xdd);
    t[i + 8] = _mm512_shuffle_i32x4(m[i + 8], m[i + 12], 0x88);
    t[i + 12] = _mm512_shuffle_i32x4(m[i + 8], m[i + 12], 0xdd);
  }
  for (int i = 0; i < 4; ++i) {
    m[i] = _mm512_shuffle_i32x4(t[i], t[i + 8], 0x88);
    m[i + 8] = _mm512_shuffle_i32x4(t[i], t[i + 8], 0xdd);
    m[i + 4] = _mm512_shuffle_i32x4(t[i + 4], t[i + 12], 0x88);
    m[i + 12] = _mm512_shuffle_i32x4(t[i + 4], t[i + 12], 0xdd);
  }
}

// One tile whose rows are 16 columns of m from `column` on, each 32 values from
// `row` on. rounded[i]: row i.
PAIR_TARGET inline void RoundColumns(Mat<const float> m, Index column, Index row,
                                     __m512i* rounded) {
  const __mmask16 low = Mask(m.rows - row);
  const __mmask16 high = Mask(m.rows - row - 16);
  for (Index i = 0; i < kRows; ++i) {
    if (column + i >= m.cols) {
      rounded[i] = _mm512_setzero_si512();
      continue;
    }
    const float* p = m.col(column + i) + row;
    rounded[i] = Round(_mm512_maskz_loadu_ps(low, p), _mm512_maskz_loadu_ps(high, p + 16));
  }
}

// One tile whose row i holds the pairs (m(row + k, column + 2i), m(row + k, column
// + 2i + 1)), k = 0 .. 15.
PAIR_TARGET inline void RoundPairs(Mat<const float> m, Index column, Index row, __m512i* rounded) {
  alignas(64) static constexpr std::uint16_t kInterleave[32] = {
      0, 16, 1, 17, 2,  18, 3,  19, 4,  20, 5,  21, 6,  22, 7,  23,
      8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31};
  const __m512i interleave = _mm512_load_si512(kInterleave);
  const __mmask16 mask = Mask(m.rows - row);
  for (Index i = 0; i < kRows; ++i) {
    const Index j = column + 2 * i;
    const __m512 a = j < m.cols ? _mm512_maskz_loadu_ps(mask, m.col(j) + row) : _mm512_setzero_ps();
    const __m512 b =
        j + 1 < m.cols ? _mm512_maskz_loadu_ps(mask, m.col(j + 1) + row) : _mm512_setzero_ps();
    rounded[i] = _mm512_permutexvar_epi16(interleave, Round(a, b));
  }
}

PAIR_TARGET inline void StoreTile(const __m512i* rows, std::uint16_t* tile) {
  for (Index i = 0; i < kRows; ++i) _mm512_store_si512(tile + i * kDepth, rows[i]);
}

// m^T as left tiles: rows are m's columns, depth its rows.
PAIR_TARGET void PackLeft(Mat<const float> m, std::uint16_t* tiles) {
  __m512i rows[16];
  for (Index i = 0; i < m.cols; i += kRows) {
    for (Index k = 0; k < m.rows; k += kDepth, tiles += kTile) {
      RoundColumns(m, i, k, rows);
      StoreTile(rows, tiles);
    }
  }
}

// m as left tiles: rows are m's rows, depth its columns.
PAIR_TARGET void PackLeftOfRows(Mat<const float> m, std::uint16_t* tiles) {
  __m512i rows[16];
  for (Index i = 0; i < m.rows; i += kRows) {
    for (Index k = 0; k < m.cols; k += kDepth, tiles += kTile) {
      RoundPairs(m, k, i, rows);
      Transpose(rows);
      StoreTile(rows, tiles);
    }
  }
}

// m^T as right tiles: depth is m's columns, width its rows.
PAIR_TARGET void PackRight(Mat<const float> m, std::uint16_t* tiles) {
  __m512i rows[16];
  for (Index i = 0; i < m.rows; i += kRows) {
    for (Index k = 0; k < m.cols; k += kDepth, tiles += kTile) {
      RoundPairs(m, k, i, rows);
      StoreTile(rows, tiles);
    }
  }
}

// m as right tiles: depth is m's rows, width its columns.
PAIR_TARGET void PackRightOfRows(Mat<const float> m, std::uint16_t* tiles) {
  __m512i rows[16];
  for (Index i = 0; i < m.cols; i += kRows) {
    for (Index k = 0; k < m.rows; k += kDepth, tiles += kTile) {
      RoundColumns(m, i, k, rows);
      Transpose(rows);
      StoreTile(rows, tiles);
    }
  }
}

// What a product starts from: c itself, zero, or a bias repeated in every column.
enum class Start { kSum, kZero, kBias };

// A 16 x 16 block that reaches over the edge of c, by way of `block`: its row i is
// column i of c.
PAIR_TARGET inline void ReadEdge(const float* c, Index stride, Index columns, Index rows,
                                 float* block) {
  const __mmask16 mask = Mask(rows);
  for (Index i = 0; i < kRows; ++i) {
    const __mmask16 row = i < columns ? mask : __mmask16{0};
    _mm512_store_ps(block + i * 16, _mm512_maskz_loadu_ps(row, c + i * stride));
  }
}
PAIR_TARGET inline void WriteEdge(const float* block, float* c, Index stride, Index columns,
                                  Index rows) {
  const __mmask16 mask = Mask(rows);
  for (Index i = 0; i < std::min(columns, kRows); ++i) {
    _mm512_mask_storeu_ps(c + i * stride, mask, _mm512_load_ps(block + i * 16));
  }
}

// c^T = start + left right: c's columns are the rows of the left tiles, its rows the
// columns of the right ones. Blocks of 2 x 2 tiles.
TILE_TARGET void MultiplyTiles(const std::uint16_t* left, const std::uint16_t* right, Index depth,
                               Start start, const float* bias, Mat<float> c) {
  alignas(64) float edge[4][256];
  const Index stride = depth * kTile;  // factors from one block to the next
  const Index bytes = c.stride * static_cast<Index>(sizeof(float));
  for (Index i = 0; i < c.cols; i += 2 * kRows) {
    const bool two_left = i + kRows < c.cols;
    const std::uint16_t* a = left + i / kRows * stride;
    for (Index j = 0; j < c.rows; j += 2 * kRows) {
      const bool two_right = j + kRows < c.rows;
      const std::uint16_t* b = right + j / kRows * stride;
      const bool inside = i + 2 * kRows <= c.cols && j + 2 * kRows <= c.rows;
      if (start == Start::kBias) {
        // A stride of zero repeats the row.
        const float* second = two_right ? bias + j + 16 : bias + j;
        _tile_loadd(0, bias + j, 0);
        _tile_loadd(1, second, 0);
        _tile_loadd(2, bias + j, 0);
        _tile_loadd(3, second, 0);
      } else if (inside && start == Start::kSum) {
        _tile_loadd(0, c.col(i) + j, bytes);
        _tile_loadd(1, c.col(i) + j + 16, bytes);
        _tile_loadd(2, c.col(i + 16) + j, bytes);
        _tile_loadd(3, c.col(i + 16) + j + 16, bytes);
      } else if (start == Start::kSum) {
        ReadEdge(c.col(i) + j, c.stride, c.cols - i, c.rows - j, edge[0]);
        _tile_loadd(0, edge[0], 64);
        if (two_right) {
          ReadEdge(c.col(i) + j + 16, c.stride, c.cols - i, c.rows - j - 16, edge[1]);
          _tile_loadd(1, edge[1], 64);
        }
        if (two_left) {
          ReadEdge(c.col(i + 16) + j, c.stride, c.cols - i - 16, c.rows - j, edge[2]);
          _tile_loadd(2, edge[2], 64);
        }
        if (two_left && two_right) {
          ReadEdge(c.col(i + 16) + j + 16, c.stride, c.cols - i - 16, c.rows - j - 16, edge[3]);
          _tile_loadd(3, edge[3], 64);
        }
      } else {
        _tile_zero(0);
        _tile_zero(1);
        _tile_zero(2);
        _tile_zero(3);
      }
      for (Index k = 0; k < depth; ++k, a += kTile, b += kTile) {
        _tile_loadd(4, a, 64);
        _tile_loadd(6, b, 64);
        _tile_dpbf16ps(0, 4, 6);
        if (two_right) {
          _tile_loadd(7, b + stride, 64);
          _tile_dpbf16ps(1, 4, 7);
        }
        if (two_left) {
          _tile_loadd(5, a + stride, 64);
          _tile_dpbf16ps(2, 5, 6);
          if (two_right) _tile_dpbf16ps(3, 5, 7);
        }
      }
      a -= stride;
      if (inside) {
        _tile_stored(0, c.col(i) + j, bytes);
        _tile_stored(1, c.col(i) + j + 16, bytes);
        _tile_stored(2, c.col(i + 16) + j, bytes);
        _tile_stored(3, c.col(i + 16) + j + 16, bytes);
        continue;
      }
      _tile_stored(0, edge[0], 64);
      WriteEdge(edge[0], c.col(i) + j, c.stride, c.cols - i, c.rows - j);
      if (two_right) {
        _tile_stored(1, edge[1], 64);
        WriteEdge(edge[1], c.col(i) + j + 16, c.stride, c.cols - i, c.rows - j - 16);
      }
      if (two_left) {
        _tile_stored(2, edge[2], 64);
        WriteEdge(edge[2], c.col(i + 16) + j, c.stride, c.cols - i - 16, c.rows - j);
      }
      if (two_left && two_right) {
        _tile_stored(3, edge[3], 64);
        WriteEdge(edge[3], c.col(i + 16) + j + 16, c.stride, c.cols - i - 16, c.rows - j - 16);
      }
    }
  }
}

// The same block by block of `Rows` left rows and `Columns` vectors of right columns, at
// c(j, i). Sums are made in the order of the pairs, whatever stands beside them.
template <int Rows, int Columns>
PAIR_TARGET inline void MultiplyPairsOf(const std::uint16_t* left, const std::uint16_t* right,
                                        Index depth, Start start, const float* bias, Index i,
                                        Index j, Mat<float> c) {
  const Index stride = depth * kTile;
  const Index rows = std::min<Index>(Rows, c.cols - i);
  const auto mask = [last = Mask(c.rows - j - 16 * (Columns - 1))](int v) {
    return v + 1 < Columns ? __mmask16{0xffff} : last;
  };
  __m512 sums[Rows][Columns];
  for (int r = 0; r < Rows; ++r) {
    for (int v = 0; v < Columns; ++v) {
      if (start == Start::kBias) {
        sums[r][v] = _mm512_maskz_loadu_ps(mask(v), bias + j + 16 * v);
      } else if (start == Start::kSum && r < rows) {
        sums[r][v] = _mm512_maskz_loadu_ps(mask(v), c.col(i + r) + j + 16 * v);
      } else {
        sums[r][v] = _mm512_setzero_ps();
      }
    }
  }
  const std::uint16_t* a = left + i / kRows * stride + i % kRows * kDepth;
  const std::uint16_t* b = right + j / kRows * stride;
  for (Index k = 0; k < depth; ++k, a += kTile, b += kTile) {
    for (Index pair = 0; pair < kDepth / 2; ++pair) {
      __m512bh factors[Columns];
#pragma GCC unroll 3
      for (int v = 0; v < Columns; ++v) {
        factors[v] = reinterpret_cast<__m512bh>(_mm512_load_si512(b + v * stride + pair * kDepth));
      }
#pragma GCC unroll 8
      for (int r = 0; r < Rows; ++r) {
        std::int32_t two;
        std::memcpy(&two, a + r * kDepth + 2 * pair, sizeof two);
        const __m512bh row = reinterpret_cast<__m512bh>(_mm512_set1_epi32(two));
#pragma GCC unroll 3
        for (int v = 0; v < Columns; ++v) {
          sums[r][v] = _mm512_dpbf16_ps(sums[r][v], row, factors[v]);
        }
      }
    }
  }
  for (int r = 0; r < rows; ++r) {
    for (int v = 0; v < Columns; ++v) {
      _mm512_mask_storeu_ps(c.col(i + r) + j + 16 * v, mask(v), sums[r][v]);
    }
  }
}

template <int Rows>
PAIR_TARGET void MultiplyRowsOfPairs(const std::uint16_t* left, const std::uint16_t* right,
                                     Index depth, Start start, const float* bias, Index i,
                                     Mat<float> c) {
  Index j = 0;
  for (; j + 32 < c.rows; j += 48) {
    MultiplyPairsOf<Rows, 3>(left, right, depth, start, bias, i, j, c);
  }
  if (j + 16 < c.rows) {
    MultiplyPairsOf<Rows, 2>(left, right, depth, start, bias, i, j, c);
  } else if (j < c.rows) {
    MultiplyPairsOf<Rows, 1>(left, right, depth, start, bias, i, j, c);
  }
}

// c^T = start + left right, as MultiplyTiles, without the tile unit: up to 24 vectors of
// sums in registers, two rows at a time where only a few are left.
PAIR_TARGET void MultiplyPairs(const std::uint16_t* left, const std::uint16_t* right, Index depth,
                               Start start, const float* bias, Mat<float> c) {
  Index i = 0;
  for (; i + 4 < c.cols; i += 8) {
    MultiplyRowsOfPairs<8>(left, right, depth, start, bias, i, c);
  }
  for (; i < c.cols; i += 2) {
    MultiplyRowsOfPairs<2>(left, right, depth, start, bias, i, c);
  }
}

// A product by the unit that the chosen instruction set has.
class Product {
 public:
  Product() : tiles_(ChosenInstructionSet() >= InstructionSet::kAmx) {
    if (tiles_) BeginTiles();
  }
  ~Product() {
    if (tiles_) EndTiles();
  }
  Product(const Product&) = delete;
  Product& operator=(const Product&) = delete;

  void Multiply(const std::uint16_t* left, const std::uint16_t* right, Index depth, Start start,
                const float* bias, Mat<float> c) const {
    (tiles_ ? MultiplyTiles : MultiplyPairs)(left, right, depth, start, bias, c);
  }

 private:
  const bool tiles_;
};

// y = start + (tiles) x, 32 columns of x at a time so that they stay in the first-level
// cache.
void MultiplyColumns(const std::uint16_t* tiles, Start start, const float* bias, Mat<const float> x,
                     Mat<float> y, std::uint16_t* scratch) {
  const Index depth = Blocks(x.rows, kDepth);
  const Product product;
  for (Index first = 0; first < x.cols; first += 2 * kRows) {
    const Index n = std::min(2 * kRows, x.cols - first);
    PackLeft(x.Cols(first, n), scratch);
    product.Multiply(scratch, tiles, depth, start, bias, y.Cols(first, n));
  }
}

// Two rows of left tiles, as many as MultiplyColumns rounds at once.
std::uint16_t* Samples(Index rows, Bfloat16Scratch* scratch) {
  return scratch->left.Reserve(2 * Blocks(rows, kDepth) * kTile);
}

}  // namespace

Bfloat16Weights::Bfloat16Weights(const std::vector<WeightPart>& parts) {
  Index size = 0;
  for (const WeightPart& part : parts) {
    Packed packed;
    packed.part = part;
    packed.forward = size;
    size += Blocks(part.rows, kRows) * Blocks(part.cols, kDepth) * kTile;
    packed.transposed = size;
    size += Blocks(part.cols, kRows) * Blocks(part.rows, kDepth) * kTile;
    parts_.push_back(packed);
  }
  tiles_.Reserve(size);
}

void Bfloat16Weights::Pack(const float* values) {
  for (const Packed& packed : parts_) {
    const WeightPart& part = packed.part;
    const Mat<const float> w(values + part.offset + part.first * part.rows, part.rows, part.cols);
    PackRight(w, tiles_.data() + packed.forward);
    PackRightOfRows(w, tiles_.data() + packed.transposed);
  }
}

void Bfloat16Weights::AddProduct(Index part, Mat<const float> x, Mat<float> y,
                                 Bfloat16Scratch* scratch) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  MultiplyColumns(tiles_.data() + packed.forward, Start::kSum, nullptr, x, y,
                  Samples(x.rows, scratch));
}

void Bfloat16Weights::SetProduct(Index part, const float* bias, Mat<const float> x, Mat<float> y,
                                 Bfloat16Scratch* scratch) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  MultiplyColumns(tiles_.data() + packed.forward, Start::kBias, bias, x, y,
                  Samples(x.rows, scratch));
}

void Bfloat16Weights::AddTransposedProduct(Index part, Mat<const float> dy, Mat<float> dx,
                                           Bfloat16Scratch* scratch) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  MultiplyColumns(tiles_.data() + packed.transposed, Start::kSum, nullptr, dy, dx,
                  Samples(dy.rows, scratch));
}

void Bfloat16Weights::SetTransposedProduct(Index part, Mat<const float> dy, Mat<float> dx,
                                           Bfloat16Scratch* scratch) const {
  const Packed& packed = parts_[static_cast<std::size_t>(part)];
  MultiplyColumns(tiles_.data() + packed.transposed, Start::kZero, nullptr, dy, dx,
                  Samples(dy.rows, scratch));
}

void AddRoundedOuterProduct(Mat<const float> dy, Mat<const float> x, Mat<float> dw,
                            Bfloat16Scratch* scratch) {
  // dw^T [in, out] += x [in, n] dy^T [n, out].
  const Product product;
  for (Index first = 0; first < x.cols; first += kSamplesPerChunk) {
    const Index n = std::min(kSamplesPerChunk, x.cols - first);
    const Index depth = Blocks(n, kDepth);
    std::uint16_t* left = scratch->left.Reserve(Blocks(x.rows, kRows) * depth * kTile);
    std::uint16_t* right = scratch->right.Reserve(Blocks(dy.rows, kRows) * depth * kTile);
    PackLeftOfRows(x.Cols(first, n), left);
    PackRight(dy.Cols(first, n), right);
    product.Multiply(left, right, depth, Start::kSum, nullptr, dw);
  }
}

#else

// Never called.
Bfloat16Weights::Bfloat16Weights(const std::vector<WeightPart>&) { std::abort(); }
void Bfloat16Weights::Pack(const float*) { std::abort(); }
void Bfloat16Weights::AddProduct(Index, Mat<const float>, Mat<float>, Bfloat16Scratch*) const {
  std::abort();
}
void Bfloat16Weights::AddTransposedProduct(Index, Mat<const float>, Mat<float>,
                                           Bfloat16Scratch*) const {
  std::abort();
}
void Bfloat16Weights::SetProduct(Index, const float*, Mat<const float>, Mat<float>,
                                 Bfloat16Scratch*) const {
  std::abort();
}
void Bfloat16Weights::SetTransposedProduct(Index, Mat<const float>, Mat<float>,
                                           Bfloat16Scratch*) const {
  std::abort();
}
void AddRoundedOuterProduct(Mat<const float>, Mat<const float>, Mat<float>, Bfloat16Scratch*) {
  std::abort();
}

#endif

}  // namespace dreamsearch::networks
