// Over 400 lines: Highway compiles this file once for each instruction set, and the kernels are
// built from each other.
#include "plugins/networks/elementwise.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "plugins/networks/elementwise.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "plugins/networks/dispatch.h"
#include "plugins/networks/vector-inl.h"

#ifndef DREAMSEARCH_NETWORKS_ELEMENTWISE_KERNELS
#define DREAMSEARCH_NETWORKS_ELEMENTWISE_KERNELS

// Every function of elementwise.h; see dispatch.h.
#define DREAMSEARCH_ELEMENTWISE(KERNEL)                                                            \
  KERNEL(void, FillColumns, (const T* bias, Mat<T> y), (bias, y))                                  \
  KERNEL(void, Add, (In<T> x, Mat<T> y), (x, y))                                                   \
  KERNEL(void, AddColumnSums, (In<T> d, T * sum), (d, sum))                                        \
  KERNEL(void, Elu, (Mat<T> x), (x))                                                               \
  KERNEL(void, EluBackward, (In<T> y, Mat<T> d), (y, d))                                           \
  KERNEL(void, LayerNorm,                                                                          \
         (AfterNorm after, const T* scale, const T* shift, Mat<T> x, Mat<T> unit, Mat<T> inverse), \
         (after, scale, shift, x, unit, inverse))                                                  \
  KERNEL(void, LayerNormBackward,                                                                  \
         (AfterNorm after, const T* scale, const T* shift, In<T> unit, In<T> inverse, In<T> y,     \
          Mat<T> d, T* d_scale, T* d_shift),                                                       \
         (after, scale, shift, unit, inverse, y, d, d_scale, d_shift))                             \
  KERNEL(void, GruForward,                                                                         \
         (In<T> input, In<T> recurrent, In<T> previous, Mat<T> gates, Mat<T> next),                \
         (input, recurrent, previous, gates, next))                                                \
  KERNEL(void, GruBackward,                                                                        \
         (In<T> gates, In<T> previous, In<T> d_next, Mat<T> d_input, Mat<T> d_recurrent,           \
          Mat<T> d_previous),                                                                      \
         (gates, previous, d_next, d_input, d_recurrent, d_previous))                              \
  KERNEL(void, GaussianForward, (In<T> raw, In<T> noise, T min_std, Mat<T> std, Mat<T> sample),    \
         (raw, noise, min_std, std, sample))                                                       \
  KERNEL(void, GaussianBackward,                                                                   \
         (In<T> std, In<T> noise, T min_std, In<T> d_sample, Mat<T> d_raw),                        \
         (std, noise, min_std, d_sample, d_raw))                                                   \
  KERNEL(void, GaussianKl, (In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, Mat<T> kl),        \
         (q_raw, q_std, p_raw, p_std, kl))                                                         \
  KERNEL(void, GaussianKlBackward,                                                                 \
         (In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, T min_std, In<T> weight, T q_factor, \
          T p_factor, Mat<T> d_q, Mat<T> d_p),                                                     \
         (q_raw, q_std, p_raw, p_std, min_std, weight, q_factor, p_factor, d_q, d_p))              \
  KERNEL(double, SquaredError, (In<T> prediction, In<T> target, T factor, Mat<T> d),               \
         (prediction, target, factor, d))                                                          \
  KERNEL(double, BernoulliError, (In<T> logit, In<T> target, T factor, Mat<T> d),                  \
         (logit, target, factor, d))                                                               \
  KERNEL(void, Sigmoid, (In<T> x, Mat<T> y), (x, y))                                               \
  KERNEL(void, Atanh, (Mat<T> x), (x))                                                             \
  KERNEL(void, ActorForward,                                                                       \
         (In<T> raw, In<T> noise, const ActorShape& shape, Mat<T> squashed, Mat<T> std,            \
          Mat<T> action, Mat<T> entropy),                                                          \
         (raw, noise, shape, squashed, std, action, entropy))                                      \
  KERNEL(void, ActorBackward,                                                                      \
         (In<T> squashed, In<T> std, In<T> action, In<T> noise, const ActorShape& shape,           \
          In<T> d_action, In<T> entropy_weight, In<T> d_gaussian, Mat<T> d_raw),                   \
         (squashed, std, action, noise, shape, d_action, entropy_weight, d_gaussian, d_raw))       \
  KERNEL(void, ApplyAdam,                                                                          \
         (const AdamStep& step, Index count, const T* gradient, T* first, T* second, T* value),    \
         (step, count, gradient, first, second, value))                                            \
  KERNEL(double, SumOfSquares, (const T* x, Index count), (x, count))                              \
  KERNEL(void, MoveTowards, (const T* fast, T rate, Index count, T* slow),                         \
         (fast, rate, count, slow))

namespace dreamsearch::networks {

DREAMSEARCH_KERNEL_TABLE(ElementwiseKernels, DREAMSEARCH_ELEMENTWISE)

}  // namespace dreamsearch::networks
#endif

HWY_BEFORE_NAMESPACE();
namespace dreamsearch::networks {
namespace HWY_NAMESPACE {
namespace {

template <typename T>
constexpr Index kLanes = static_cast<Index>(HWY_LANES(T));
constexpr double kHalfLogTwoPi = 0.91893853320467274178;

template <typename T>
HWY_INLINE Vector<T> Load(const T* p, Index n) {
  return LoadUpTo(Tag<T>(), p, n);
}
template <typename T>
HWY_INLINE void Store(Vector<T> v, T* p, Index n) {
  StoreUpTo(v, Tag<T>(), p, n);
}
template <class V>
HWY_INLINE V Square(V x) {
  return hn::Mul(x, x);
}

// Calls kernel(column, row, values left) over the registers of an [rows, cols] matrix.
template <typename T, typename Kernel>
HWY_INLINE void ForVectors(Index rows, Index cols, Kernel kernel) {
  for (Index j = 0; j < cols; ++j) {
    for (Index i = 0; i < rows; i += kLanes<T>) kernel(j, i, rows - i);
  }
}

// A dense matrix as one long column.
template <typename T>
Mat<T> Flat(Mat<T> m) {
  return m.dense() ? Mat<T>(m.data, m.size(), 1) : m;
}

template <typename T>
void FillColumns(const T* bias, Mat<T> y) {
  for (Index j = 0; j < y.cols; ++j) std::copy(bias, bias + y.rows, y.col(j));
}

template <typename T>
void Add(In<T> x, Mat<T> y) {
  ForVectors<T>(y.rows, y.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    Store<T>(hn::Add(Load(y.col(j) + i, n), Load(x.col(j) + i, n)), y.col(j) + i, n);
  });
}

template <typename T>
void AddColumnSums(In<T> d, T* sum) {
  for (Index i = 0; i < d.rows; i += kLanes<T>) {
    const Index n = d.rows - i;
    Vector<T> total = Load(sum + i, n);
    for (Index j = 0; j < d.cols; ++j) total = hn::Add(total, Load(d.col(j) + i, n));
    Store<T>(total, sum + i, n);
  }
}

template <typename T>
void Elu(Mat<T> matrix) {
  const Mat<T> x = Flat(matrix);
  ForVectors<T>(x.rows, x.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    Store<T>(EluOf<T>(Load(x.col(j) + i, n)), x.col(j) + i, n);
  });
}

template <typename T>
void Atanh(Mat<T> matrix) {
  const Mat<T> x = Flat(matrix);
  ForVectors<T>(x.rows, x.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    Store<T>(hn::Atanh(Tag<T>(), Load(x.col(j) + i, n)), x.col(j) + i, n);
  });
}

template <typename T>
void EluBackward(In<T> y, Mat<T> d) {
  ForVectors<T>(d.rows, d.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    Store<T>(hn::Mul(Load(d.col(j) + i, n), EluSlope<T>(Load(y.col(j) + i, n))), d.col(j) + i, n);
  });
}

// What follows a layer normalisation: the output from scale * unit + shift, and its slope
// there, for which the output may serve.
template <typename T>
struct EluAfter {
  static HWY_INLINE Vector<T> Of(Vector<T> x) { return EluOf<T>(x); }
  static HWY_INLINE Vector<T> Slope(Vector<T>, Vector<T> y) { return EluSlope<T>(y); }
};
template <typename T>
struct MishAfter {
  static HWY_INLINE Vector<T> Of(Vector<T> x) { return MishOf<T>(x); }
  static HWY_INLINE Vector<T> Slope(Vector<T> x, Vector<T>) { return MishSlope<T>(x); }
};
template <typename T>
struct NothingAfter {
  static HWY_INLINE Vector<T> Of(Vector<T> x) { return x; }
  static HWY_INLINE Vector<T> Slope(Vector<T>, Vector<T>) { return Constant<T>(1); }
};

template <typename T, class After>
HWY_INLINE void Normalise(const T* scale, const T* shift, Mat<T> x, Mat<T> unit, Mat<T> inverse) {
  const T count = static_cast<T>(x.rows);
  const Index full = x.rows / kLanes<T> * kLanes<T>;
  for (Index j = 0; j < x.cols; ++j) {
    T* column = x.col(j);
    T* normalised = unit.col(j);
    Vector<T> total = Constant<T>(0);
    for (Index i = 0; i < x.rows; i += kLanes<T>) {
      total = hn::Add(total, Load(column + i, x.rows - i));
    }
    const T mean = SumOf<T>(total) / count;
    const Vector<T> means = hn::Set(Tag<T>(), mean);
    Vector<T> squares = Constant<T>(0);
    for (Index i = 0; i < full; i += kLanes<T>) {
      squares = hn::Add(squares, Square(hn::Sub(Load(column + i, kLanes<T>), means)));
    }
    T sum = SumOf<T>(squares);
    for (Index i = full; i < x.rows; ++i) sum += (column[i] - mean) * (column[i] - mean);
    inverse(0, j) = T(1) / std::sqrt(sum / count + T(1e-5));
    const Vector<T> factor = hn::Set(Tag<T>(), inverse(0, j));
    for (Index i = 0; i < x.rows; i += kLanes<T>) {
      const Index n = x.rows - i;
      const Vector<T> u = hn::Mul(hn::Sub(Load(column + i, n), means), factor);
      Store<T>(u, normalised + i, n);
      Store<T>(After::Of(hn::MulAdd(Load(scale + i, n), u, Load(shift + i, n))), column + i, n);
    }
  }
}

template <typename T, class After>
HWY_INLINE void NormaliseBackward(const T* scale, const T* shift, In<T> unit, In<T> inverse,
                                  In<T> y, Mat<T> d, T* d_scale, T* d_shift) {
  const T count = static_cast<T>(d.rows);
  for (Index j = 0; j < d.cols; ++j) {
    T* column = d.col(j);
    const T* u = unit.col(j);
    const T* output = y.col(j);
    Vector<T> sum = Constant<T>(0);
    Vector<T> along = Constant<T>(0);
    for (Index i = 0; i < d.rows; i += kLanes<T>) {
      const Index n = d.rows - i;
      const Vector<T> normalised = Load(u + i, n);
      const Vector<T> factor = Load(scale + i, n);
      const Vector<T> x = hn::MulAdd(factor, normalised, Load(shift + i, n));
      const Vector<T> raw = hn::Mul(Load(column + i, n), After::Slope(x, Load(output + i, n)));
      const Vector<T> g = hn::Mul(raw, factor);
      Store<T>(g, column + i, n);
      sum = hn::Add(sum, g);
      along = hn::MulAdd(g, normalised, along);
      if (d_scale != nullptr) {
        Store<T>(hn::MulAdd(raw, normalised, Load(d_scale + i, n)), d_scale + i, n);
        Store<T>(hn::Add(Load(d_shift + i, n), raw), d_shift + i, n);
      }
    }
    const Vector<T> mean = hn::Set(Tag<T>(), SumOf<T>(sum) / count);
    const Vector<T> projection = hn::Set(Tag<T>(), SumOf<T>(along) / count);
    const Vector<T> factor = hn::Set(Tag<T>(), inverse(0, j));
    for (Index i = 0; i < d.rows; i += kLanes<T>) {
      const Index n = d.rows - i;
      const Vector<T> centred = hn::Sub(Load(column + i, n), mean);
      Store<T>(hn::Mul(hn::NegMulAdd(Load(u + i, n), projection, centred), factor), column + i, n);
    }
  }
}

template <typename T>
void LayerNorm(AfterNorm after, const T* scale, const T* shift, Mat<T> x, Mat<T> unit,
               Mat<T> inverse) {
  switch (after) {
    case AfterNorm::kNothing:
      return Normalise<T, NothingAfter<T>>(scale, shift, x, unit, inverse);
    case AfterNorm::kElu:
      return Normalise<T, EluAfter<T>>(scale, shift, x, unit, inverse);
    case AfterNorm::kMish:
      return Normalise<T, MishAfter<T>>(scale, shift, x, unit, inverse);
  }
}

template <typename T>
void LayerNormBackward(AfterNorm after, const T* scale, const T* shift, In<T> unit, In<T> inverse,
                       In<T> y, Mat<T> d, T* d_scale, T* d_shift) {
  switch (after) {
    case AfterNorm::kNothing:
      return NormaliseBackward<T, NothingAfter<T>>(scale, shift, unit, inverse, y, d, d_scale,
                                                   d_shift);
    case AfterNorm::kElu:
      return NormaliseBackward<T, EluAfter<T>>(scale, shift, unit, inverse, y, d, d_scale, d_shift);
    case AfterNorm::kMish:
      return NormaliseBackward<T, MishAfter<T>>(scale, shift, unit, inverse, y, d, d_scale,
                                                d_shift);
  }
}

template <typename T>
void GruForward(In<T> input, In<T> recurrent, In<T> previous, Mat<T> gates, Mat<T> next) {
  const Index size = next.rows;
  ForVectors<T>(size, next.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    const T* in = input.col(j) + i;
    const T* rec = recurrent.col(j) + i;
    T* g = gates.col(j) + i;
    const Vector<T> r = Logistic<T>(hn::Add(Load(in, n), Load(rec, n)));
    const Vector<T> u = Logistic<T>(hn::Add(Load(in + size, n), Load(rec + size, n)));
    const Vector<T> h = Load(rec + 2 * size, n);
    const Vector<T> c = Tanh(hn::MulAdd(r, h, Load(in + 2 * size, n)));
    Store<T>(r, g, n);
    Store<T>(u, g + size, n);
    Store<T>(c, g + 2 * size, n);
    Store<T>(h, g + 3 * size, n);
    Store<T>(hn::MulAdd(u, hn::Sub(Load(previous.col(j) + i, n), c), c), next.col(j) + i, n);
  });
}

template <typename T>
void GruBackward(In<T> gates, In<T> previous, In<T> d_next, Mat<T> d_input, Mat<T> d_recurrent,
                 Mat<T> d_previous) {
  const Index size = d_next.rows;
  const Vector<T> one = Constant<T>(1);
  ForVectors<T>(size, d_next.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    const T* g = gates.col(j) + i;
    const Vector<T> r = Load(g, n);
    const Vector<T> u = Load(g + size, n);
    const Vector<T> c = Load(g + 2 * size, n);
    const Vector<T> h = Load(g + 3 * size, n);
    const Vector<T> dy = Load(d_next.col(j) + i, n);
    const Vector<T> du =
        hn::Mul(hn::Mul(dy, hn::Sub(Load(previous.col(j) + i, n), c)), hn::Mul(u, hn::Sub(one, u)));
    const Vector<T> dc = hn::Mul(hn::Mul(dy, hn::Sub(one, u)), hn::Sub(one, Square(c)));
    const Vector<T> dr = hn::Mul(hn::Mul(dc, h), hn::Mul(r, hn::Sub(one, r)));
    T* in = d_input.col(j) + i;
    T* rec = d_recurrent.col(j) + i;
    Store<T>(dr, in, n);
    Store<T>(dr, rec, n);
    Store<T>(du, in + size, n);
    Store<T>(du, rec + size, n);
    Store<T>(dc, in + 2 * size, n);
    Store<T>(hn::Mul(dc, r), rec + 2 * size, n);
    Store<T>(hn::Mul(dy, u), d_previous.col(j) + i, n);
  });
}

template <typename T>
void GaussianForward(In<T> raw, In<T> noise, T min_std, Mat<T> std, Mat<T> sample) {
  const Index z = sample.rows;
  const Vector<T> least = hn::Set(Tag<T>(), min_std);
  ForVectors<T>(z, sample.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    const Vector<T> mean = Load(raw.col(j) + i, n);
    const Vector<T> s = hn::Add(Softplus<T>(Load(raw.col(j) + z + i, n)), least);
    if (std) Store<T>(s, std.col(j) + i, n);
    Store<T>(noise ? hn::MulAdd(s, Load(noise.col(j) + i, n), mean) : mean, sample.col(j) + i, n);
  });
}

template <typename T>
void GaussianBackward(In<T> std, In<T> noise, T min_std, In<T> d_sample, Mat<T> d_raw) {
  const Index z = d_sample.rows;
  const Vector<T> one = Constant<T>(1);
  const Vector<T> least = hn::Set(Tag<T>(), min_std);
  ForVectors<T>(z, d_sample.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    T* d_mean = d_raw.col(j) + i;
    T* d_c = d_raw.col(j) + z + i;
    const Vector<T> d = Load(d_sample.col(j) + i, n);
    // softplus'(c) = sigmoid(c) = 1 - exp(-softplus(c)).
    const Vector<T> slope = hn::Sub(one, Exp(hn::Sub(least, Load(std.col(j) + i, n))));
    Store<T>(hn::Add(Load(d_mean, n), d), d_mean, n);
    Store<T>(hn::Mul(hn::MulAdd(d, Load(noise.col(j) + i, n), Load(d_c, n)), slope), d_c, n);
  });
}

// Values of deviations, 1 beyond the end so that they can be divided by.
template <typename T>
HWY_INLINE Vector<T> LoadDeviations(const T* p, Index n) {
  const Vector<T> v = Load(p, n);
  if (n >= kLanes<T>) return v;
  return hn::IfThenElse(hn::FirstN(Tag<T>(), static_cast<std::size_t>(n)), v, Constant<T>(1));
}

template <typename T>
void GaussianKl(In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, Mat<T> kl) {
  const Index z = q_std.rows;
  const Tag<T> d;
  for (Index j = 0; j < q_std.cols; ++j) {
    Vector<T> total = Constant<T>(0);
    for (Index i = 0; i < z; i += kLanes<T>) {
      const Index n = z - i;
      const Vector<T> p = LoadDeviations(p_std.col(j) + i, n);
      const Vector<T> q = LoadDeviations(q_std.col(j) + i, n);
      const Vector<T> difference =
          hn::Div(hn::Sub(Load(q_raw.col(j) + i, n), Load(p_raw.col(j) + i, n)), p);
      const Vector<T> ratio = hn::Div(q, p);
      const Vector<T> squares =
          hn::Sub(hn::MulAdd(ratio, ratio, Square(difference)), Constant<T>(1));
      total = hn::Add(total, hn::Sub(hn::Mul(Constant<T>(0.5), squares), hn::Log(d, ratio)));
    }
    kl(0, j) = SumOf<T>(total);
  }
}

template <typename T>
void GaussianKlBackward(In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, T min_std, In<T> weight,
                        T q_factor, T p_factor, Mat<T> d_q, Mat<T> d_p) {
  const Tag<T> d;
  const Index z = q_std.rows;
  const Vector<T> one = Constant<T>(1);
  const Vector<T> least = hn::Set(d, min_std);
  const Vector<T> to_q = hn::Set(d, q_factor);
  const Vector<T> to_p = hn::Set(d, p_factor);
  ForVectors<T>(z, q_std.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    const Vector<T> w = hn::Set(d, weight(0, j));
    const Vector<T> p = LoadDeviations(p_std.col(j) + i, n);
    const Vector<T> q = LoadDeviations(q_std.col(j) + i, n);
    const Vector<T> difference = hn::Sub(Load(q_raw.col(j) + i, n), Load(p_raw.col(j) + i, n));
    const Vector<T> inverse = hn::Div(one, p);
    const Vector<T> inverse_square = Square(inverse);
    const Vector<T> d_mean = hn::Mul(hn::Mul(w, difference), inverse_square);
    const Vector<T> d_std_q = hn::Mul(w, hn::Sub(hn::Mul(q, inverse_square), hn::Div(one, q)));
    const Vector<T> squares = hn::Mul(hn::MulAdd(q, q, Square(difference)), inverse_square);
    const Vector<T> d_std_p = hn::Mul(hn::Mul(w, inverse), hn::Sub(one, squares));
    Store<T>(hn::Mul(to_q, d_mean), d_q.col(j) + i, n);
    Store<T>(hn::Mul(to_q, d_std_q), d_q.col(j) + z + i, n);
    Store<T>(hn::Neg(hn::Mul(to_p, d_mean)), d_p.col(j) + i, n);
    const Vector<T> slope = hn::Sub(one, Exp(hn::Sub(least, p)));
    Store<T>(hn::Mul(hn::Mul(to_p, d_std_p), slope), d_p.col(j) + z + i, n);
  });
}

template <typename T>
double SquaredError(In<T> prediction, In<T> target, T factor, Mat<T> d) {
  double total = 0;
  for (Index j = 0; j < d.cols; ++j) {
    T column = 0;
    for (Index i = 0; i < d.rows; ++i) {
      const T error = prediction(i, j) - target(i, j);
      d(i, j) = factor * error;
      column += T(0.5) * error * error;
    }
    total += static_cast<double>(column);
  }
  return total;
}

template <typename T>
double BernoulliError(In<T> logit, In<T> target, T factor, Mat<T> d) {
  double total = 0;
  for (Index j = 0; j < d.cols; ++j) {
    for (Index i = 0; i < d.rows; ++i) {
      const T x = logit(i, j);
      const T probability = T(1) / (T(1) + std::exp(-x));
      d(i, j) = factor * (probability - target(i, j));
      total += static_cast<double>(std::max(x, T(0)) + std::log1p(std::exp(-std::abs(x))) -
                                   x * target(i, j));
    }
  }
  return total;
}

template <typename T>
void Sigmoid(In<T> x, Mat<T> y) {
  ForVectors<T>(y.rows, y.cols, [&](Index j, Index i, Index n) HWY_ATTR {
    Store<T>(Logistic<T>(Load(x.col(j) + i, n)), y.col(j) + i, n);
  });
}

template <typename T>
void ActorForward(In<T> raw, In<T> noise, const ActorShape& shape, Mat<T> squashed, Mat<T> std,
                  Mat<T> action, Mat<T> entropy) {
  const Index a = action.rows;
  // Actions are short, so the columns are laid end to end before the registers are filled.
  for (Index j = 0; j < action.cols; ++j) {
    for (Index i = 0; i < a; ++i) {
      squashed(i, j) = raw(i, j);
      std(i, j) = raw(a + i, j);
    }
  }
  const Tag<T> d;
  const Vector<T> limit = Constant<T>(shape.bounds_log_std() ? 1 : shape.mean_limit);
  const Vector<T> offset = Constant<T>(shape.std_offset);
  const Vector<T> least = Constant<T>(shape.min_std);
  const Vector<T> middle = Constant<T>(0.5 * (shape.max_log_std + shape.min_log_std));
  const Vector<T> reach = Constant<T>(shape.log_std_reach());
  const Index total = action.size();
  if (entropy) SetZero(entropy);
  for (Index i = 0; i < total; i += kLanes<T>) {
    const Index n = total - i;
    const Vector<T> m = Load(squashed.data + i, n);
    const Vector<T> c = Load(std.data + i, n);
    // With bounds on ln std the mean has none.
    const Vector<T> t = shape.bounds_log_std() ? m : Tanh(hn::Div(m, limit));
    const Vector<T> s = shape.bounds_log_std() ? Exp(hn::MulAdd(reach, Tanh(c), middle))
                                               : hn::Add(Softplus<T>(hn::Add(c, offset)), least);
    Store<T>(t, squashed.data + i, n);
    Store<T>(s, std.data + i, n);
    if (!noise) {
      Store<T>(Tanh(hn::Mul(limit, t)), action.data + i, n);
      continue;
    }
    const Vector<T> eps = Load(noise.data + i, n);
    const Vector<T> u = hn::MulAdd(limit, t, hn::Mul(s, eps));
    Store<T>(Tanh(u), action.data + i, n);
    if (!entropy) continue;
    // - ln p(a) = ln std + eps^2 / 2 + ln(2 pi) / 2 + ln(1 - tanh(u)^2), the
    // last as 2 (ln 2 - u - softplus(-2u)), which never takes the log of 0.
    const Vector<T> two = Constant<T>(2);
    const Vector<T> last =
        hn::Sub(hn::Sub(Constant<T>(std::numbers::ln2), u), Softplus<T>(hn::Neg(hn::Mul(two, u))));
    Vector<T> e = hn::Add(hn::Log(d, s), Constant<T>(kHalfLogTwoPi));
    e = hn::MulAdd(hn::Mul(Constant<T>(0.5), eps), eps, e);
    e = hn::MulAdd(two, last, e);
    HWY_ALIGN T parts[HWY_LANES(T)];
    hn::Store(e, d, parts);
    for (Index k = 0; k < std::min<Index>(n, kLanes<T>); ++k) entropy(0, (i + k) / a) += parts[k];
  }
}

template <typename T>
void ActorBackward(In<T> squashed, In<T> std, In<T> action, In<T> noise, const ActorShape& shape,
                   In<T> d_action, In<T> entropy_weight, In<T> d_gaussian, Mat<T> d_raw) {
  const Index a = action.rows;
  const T min_std = static_cast<T>(shape.min_std);
  const T reach = static_cast<T>(shape.log_std_reach());
  const T middle = static_cast<T>(0.5 * (shape.max_log_std + shape.min_log_std));
  for (Index j = 0; j < action.cols; ++j) {
    const T weight = entropy_weight(0, j);
    for (Index i = 0; i < a; ++i) {
      const T y = action(i, j);
      T du = d_action(i, j) * (T(1) - y * y) - T(2) * weight * y;
      const T t = squashed(i, j);
      const T s = std(i, j);
      T d_std = du * noise(i, j) + weight / s;
      if (d_gaussian) {
        du += d_gaussian(i, j);
        d_std += d_gaussian(a + i, j);
      }
      if (shape.bounds_log_std()) {
        const T bounded = (std::log(s) - middle) / reach;  // tanh(c)
        d_raw(i, j) = du;
        d_raw(a + i, j) = d_std * s * reach * (T(1) - bounded * bounded);
      } else {
        d_raw(i, j) = du * (T(1) - t * t);
        d_raw(a + i, j) = d_std * (T(1) - std::exp(min_std - s));
      }
    }
  }
}

template <typename T>
void ApplyAdam(const AdamStep& step, Index count, const T* gradient, T* first, T* second,
               T* value) {
  const Vector<T> factor = Constant<T>(step.factor);
  const Vector<T> beta1 = Constant<T>(step.beta1);
  const Vector<T> beta2 = Constant<T>(step.beta2);
  const Vector<T> rest1 = hn::Sub(Constant<T>(1), beta1);
  const Vector<T> rest2 = hn::Sub(Constant<T>(1), beta2);
  const Vector<T> epsilon = Constant<T>(step.epsilon);
  const Vector<T> rate = Constant<T>(step.learning_rate * step.rate1);
  const Vector<T> rate2 = Constant<T>(step.rate2);
  for (Index i = 0; i < count; i += kLanes<T>) {
    const Index n = count - i;
    const Vector<T> g = hn::Mul(Load(gradient + i, n), factor);
    const Vector<T> m = hn::MulAdd(beta1, Load(first + i, n), hn::Mul(rest1, g));
    const Vector<T> v = hn::MulAdd(beta2, Load(second + i, n), hn::Mul(rest2, Square(g)));
    Store<T>(m, first + i, n);
    Store<T>(v, second + i, n);
    const Vector<T> down = hn::Add(hn::Sqrt(hn::Mul(v, rate2)), epsilon);
    Store<T>(hn::Sub(Load(value + i, n), hn::Div(hn::Mul(rate, m), down)), value + i, n);
  }
}

template <typename T>
double SumOfSquares(const T* x, Index count) {
  const Tag<double> d;
  constexpr Index lanes = kLanes<double>;
  Vector<double> total = Constant<double>(0);
  for (Index i = 0; i < count; i += lanes) {
    Vector<double> v;
    if constexpr (std::is_same_v<T, float>) {
      v = hn::PromoteTo(d, LoadUpTo(hn::Rebind<float, Tag<double>>(), x + i, count - i));
    } else {
      v = Load(x + i, count - i);
    }
    total = hn::MulAdd(v, v, total);
  }
  return SumOf<double>(total);
}

template <typename T>
void MoveTowards(const T* fast, T rate, Index count, T* slow) {
  const Vector<T> factor = hn::Set(Tag<T>(), rate);
  for (Index i = 0; i < count; i += kLanes<T>) {
    const Index n = count - i;
    const Vector<T> from = Load(slow + i, n);
    Store<T>(hn::MulAdd(factor, hn::Sub(Load(fast + i, n), from), from), slow + i, n);
  }
}

DREAMSEARCH_KERNELS_OF_SET(ElementwiseKernels, DREAMSEARCH_ELEMENTWISE)

}  // namespace

}  // namespace HWY_NAMESPACE
}  // namespace dreamsearch::networks
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dreamsearch::networks {
DREAMSEARCH_FORWARD_KERNELS(ElementwiseKernels, DREAMSEARCH_ELEMENTWISE)
}  // namespace dreamsearch::networks
#endif  // HWY_ONCE
