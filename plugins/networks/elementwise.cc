#include "plugins/networks/elementwise.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>

#ifdef __AVX512F__
#include <immintrin.h>
#endif

namespace dreamsearch::networks {
namespace {

constexpr int kLane = 16;

#ifdef __AVX512F__
inline __mmask16 TailMask(Index n) { return static_cast<__mmask16>((1u << n) - 1); }
#endif

template <typename T>
using Lane = Eigen::Array<T, kLane, 1>;

// Up to 16 consecutive values; the rest of the lane is zero.
template <typename T>
inline Lane<T> Load(const T* p, Index n) {
  if (n >= kLane) return Eigen::Map<const Lane<T>>(p);
  Lane<T> lane;
#ifdef __AVX512F__
  if constexpr (std::is_same_v<T, float>) {
    _mm512_storeu_ps(lane.data(), _mm512_maskz_loadu_ps(TailMask(n), p));
    return lane;
  }
#endif
  lane.setZero();
  for (Index i = 0; i < n; ++i) lane[i] = p[i];
  return lane;
}

template <typename T>
inline void Store(const Lane<T>& lane, T* p, Index n) {
  if (n >= kLane) {
    Eigen::Map<Lane<T>>{p} = lane;
    return;
  }
#ifdef __AVX512F__
  if constexpr (std::is_same_v<T, float>) {
    _mm512_mask_storeu_ps(p, TailMask(n), _mm512_loadu_ps(lane.data()));
    return;
  }
#endif
  for (Index i = 0; i < n; ++i) p[i] = lane[i];
}

// exp of every value. Activations spend most of their time here.
template <typename T>
inline Lane<T> Exp(const Lane<T>& x) {
  return x.exp();
}
#ifdef __AVX512F__
// x = n ln 2 + r with |r| <= ln 2 / 2, exp(x) = 2^n exp(r); the series of exp(r) to
// the seventh power is exact to float's rounding. ln 2 in two parts, the first
// short enough that n times it is exact.
template <>
inline Lane<float> Exp<float>(const Lane<float>& lane) {
  const __m512 x = _mm512_loadu_ps(lane.data());
  // The possible NaN second: the result is then NaN.
  const __m512 bounded = _mm512_max_ps(_mm512_set1_ps(-104.0f),
                                       _mm512_min_ps(_mm512_set1_ps(89.0f), x));
  const __m512 n = _mm512_roundscale_ps(
      _mm512_mul_ps(bounded, _mm512_set1_ps(std::numbers::log2e_v<float>)),
      _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
  __m512 r = _mm512_fnmadd_ps(n, _mm512_set1_ps(0.693359375f), bounded);
  r = _mm512_fnmadd_ps(n, _mm512_set1_ps(-2.12194440e-4f), r);
  __m512 sum = _mm512_set1_ps(1.0f / 5040);
  for (const float coefficient : {1.0f / 720, 1.0f / 120, 1.0f / 24, 1.0f / 6, 0.5f, 1.0f, 1.0f}) {
    sum = _mm512_fmadd_ps(sum, r, _mm512_set1_ps(coefficient));
  }
  Lane<float> result;
  _mm512_storeu_ps(result.data(), _mm512_scalef_ps(sum, n));
  return result;
}
#endif

// min and max with the possible NaN first: the result is then NaN.
template <typename T>
inline Lane<T> Softplus(const Lane<T>& x) {
  return x.max(T(0)) + Exp<T>(-x.abs()).log1p();
}
template <typename T>
inline Lane<T> Sigmoid(const Lane<T>& x) {
  return T(1) / (T(1) + Exp<T>(-x));
}

template <typename T>
inline Lane<T> EluOf(const Lane<T>& x) {
  return x.max(T(0)) + (Exp<T>(x.min(T(0))) - T(1));
}
// elu'(x) from y = elu(x).
template <typename T>
inline Lane<T> EluSlope(const Lane<T>& y) {
  return y.min(T(0)) + T(1);
}

// Calls kernel(column, row, lanes left) over the lanes of an [rows, cols] matrix.
template <typename Kernel>
inline void ForLanes(Index rows, Index cols, Kernel kernel) {
  for (Index j = 0; j < cols; ++j) {
    for (Index i = 0; i < rows; i += kLane) kernel(j, i, rows - i);
  }
}

// A dense matrix as one long column.
template <typename T>
Mat<T> Flat(Mat<T> m) {
  return m.dense() ? Mat<T>(m.data, m.size(), 1) : m;
}

constexpr double kHalfLogTwoPi = 0.91893853320467274178;

}  // namespace

template <typename T>
void FillColumns(const T* bias, Mat<T> y) {
  for (Index j = 0; j < y.cols; ++j) {
    std::memcpy(y.col(j), bias, static_cast<std::size_t>(y.rows) * sizeof(T));
  }
}

template <typename T>
void Add(In<T> x, Mat<T> y) {
  ForLanes(y.rows, y.cols, [&](Index j, Index i, Index n) {
    Store<T>(Load(y.col(j) + i, n) + Load(x.col(j) + i, n), y.col(j) + i, n);
  });
}

template <typename T>
void AddColumnSums(In<T> d, T* sum) {
  for (Index i = 0; i < d.rows; i += kLane) {
    const Index n = d.rows - i;
    Lane<T> total = Lane<T>::Zero();
    for (Index j = 0; j < d.cols; ++j) total += Load(d.col(j) + i, n);
    Store<T>(Load(sum + i, n) + total, sum + i, n);
  }
}

template <typename T>
void Elu(Mat<T> x) {
  const Mat<T> flat = Flat(x);
  ForLanes(flat.rows, flat.cols, [&](Index j, Index i, Index n) {
    Store<T>(EluOf<T>(Load(flat.col(j) + i, n)), flat.col(j) + i, n);
  });
}

template <typename T>
void EluBackward(In<T> y, Mat<T> d) {
  ForLanes(d.rows, d.cols, [&](Index j, Index i, Index n) {
    Store<T>(Load(d.col(j) + i, n) * EluSlope<T>(Load(y.col(j) + i, n)), d.col(j) + i, n);
  });
}

template <typename T>
void LayerNormElu(const T* scale, const T* shift, Mat<T> x, Mat<T> unit, Mat<T> inverse) {
  // A few columns at a time: each sum is one chain of additions, and the processor
  // works on several chains at once.
  constexpr Index kColumns = 8;
  const T count = static_cast<T>(x.rows);
  const Index full = x.rows / kLane * kLane;
  for (Index first = 0; first < x.cols; first += kColumns) {
    const Index columns = std::min(kColumns, x.cols - first);
    T mean[kColumns];
    for (Index j = 0; j < columns; ++j) {
      const T* column = x.col(first + j);
      Lane<T> total = Lane<T>::Zero();
      for (Index i = 0; i < x.rows; i += kLane) total += Load(column + i, x.rows - i);
      mean[j] = total.sum() / count;
    }
    for (Index j = 0; j < columns; ++j) {
      const T* column = x.col(first + j);
      Lane<T> squares = Lane<T>::Zero();
      for (Index i = 0; i < full; i += kLane) {
        squares += (Load(column + i, kLane) - mean[j]).square();
      }
      T sum = squares.sum();
      for (Index i = full; i < x.rows; ++i) sum += (column[i] - mean[j]) * (column[i] - mean[j]);
      inverse(0, first + j) = T(1) / std::sqrt(sum / count + T(1e-5));
    }
    for (Index j = 0; j < columns; ++j) {
      T* column = x.col(first + j);
      T* normalised = unit.col(first + j);
      const T factor = inverse(0, first + j);
      for (Index i = 0; i < x.rows; i += kLane) {
        const Index n = x.rows - i;
        const Lane<T> u = (Load(column + i, n) - mean[j]) * factor;
        Store<T>(u, normalised + i, n);
        Store<T>(EluOf<T>(Load(scale + i, n) * u + Load(shift + i, n)), column + i, n);
      }
    }
  }
}

template <typename T>
void LayerNormEluBackward(const T* scale, In<T> unit, In<T> inverse, In<T> y, Mat<T> d, T* d_scale,
                          T* d_shift) {
  const T count = static_cast<T>(d.rows);
  for (Index j = 0; j < d.cols; ++j) {
    T* column = d.col(j);
    const T* u = unit.col(j);
    const T* output = y.col(j);
    Lane<T> sum = Lane<T>::Zero();
    Lane<T> along = Lane<T>::Zero();
    for (Index i = 0; i < d.rows; i += kLane) {
      const Index n = d.rows - i;
      const Lane<T> raw = Load(column + i, n) * EluSlope<T>(Load(output + i, n));
      const Lane<T> lane_unit = Load(u + i, n);
      const Lane<T> g = raw * Load(scale + i, n);
      Store<T>(g, column + i, n);
      sum += g;
      along += g * lane_unit;
      if (d_scale != nullptr) {
        Store<T>(Load(d_scale + i, n) + raw * lane_unit, d_scale + i, n);
        Store<T>(Load(d_shift + i, n) + raw, d_shift + i, n);
      }
    }
    const T mean = sum.sum() / count;
    const T projection = along.sum() / count;
    const T factor = inverse(0, j);
    for (Index i = 0; i < d.rows; i += kLane) {
      const Index n = d.rows - i;
      Store<T>((Load(column + i, n) - mean - Load(u + i, n) * projection) * factor, column + i, n);
    }
  }
}

template <typename T>
void GruForward(In<T> input, In<T> recurrent, In<T> previous, Mat<T> gates, Mat<T> next) {
  const Index d = next.rows;
  ForLanes(d, next.cols, [&](Index j, Index i, Index n) {
    const T* in = input.col(j) + i;
    const T* rec = recurrent.col(j) + i;
    T* g = gates.col(j) + i;
    const Lane<T> r = Sigmoid<T>(Load(in, n) + Load(rec, n));
    const Lane<T> u = Sigmoid<T>(Load(in + d, n) + Load(rec + d, n));
    const Lane<T> h = Load(rec + 2 * d, n);
    const Lane<T> c = (Load(in + 2 * d, n) + r * h).tanh();
    Store<T>(r, g, n);
    Store<T>(u, g + d, n);
    Store<T>(c, g + 2 * d, n);
    Store<T>(h, g + 3 * d, n);
    Store<T>(c + u * (Load(previous.col(j) + i, n) - c), next.col(j) + i, n);
  });
}

template <typename T>
void GruBackward(In<T> gates, In<T> previous, In<T> d_next, Mat<T> d_input, Mat<T> d_recurrent,
                 Mat<T> d_previous) {
  const Index d = d_next.rows;
  ForLanes(d, d_next.cols, [&](Index j, Index i, Index n) {
    const T* g = gates.col(j) + i;
    const Lane<T> r = Load(g, n);
    const Lane<T> u = Load(g + d, n);
    const Lane<T> c = Load(g + 2 * d, n);
    const Lane<T> h = Load(g + 3 * d, n);
    const Lane<T> dy = Load(d_next.col(j) + i, n);
    const Lane<T> du = dy * (Load(previous.col(j) + i, n) - c) * u * (T(1) - u);
    const Lane<T> dc = dy * (T(1) - u) * (T(1) - c.square());
    const Lane<T> dr = dc * h * r * (T(1) - r);
    T* in = d_input.col(j) + i;
    T* rec = d_recurrent.col(j) + i;
    Store<T>(dr, in, n);
    Store<T>(dr, rec, n);
    Store<T>(du, in + d, n);
    Store<T>(du, rec + d, n);
    Store<T>(dc, in + 2 * d, n);
    Store<T>(dc * r, rec + 2 * d, n);
    Store<T>(dy * u, d_previous.col(j) + i, n);
  });
}

template <typename T>
void GaussianForward(In<T> raw, In<T> noise, T min_std, Mat<T> std, Mat<T> sample) {
  const Index z = sample.rows;
  ForLanes(z, sample.cols, [&](Index j, Index i, Index n) {
    const Lane<T> mean = Load(raw.col(j) + i, n);
    const Lane<T> s = Softplus<T>(Load(raw.col(j) + z + i, n)) + min_std;
    if (std) Store<T>(s, std.col(j) + i, n);
    Store<T>(noise ? Lane<T>(mean + s * Load(noise.col(j) + i, n)) : mean, sample.col(j) + i, n);
  });
}

template <typename T>
void GaussianBackward(In<T> std, In<T> noise, T min_std, In<T> d_sample, Mat<T> d_raw) {
  const Index z = d_sample.rows;
  ForLanes(z, d_sample.cols, [&](Index j, Index i, Index n) {
    T* d_mean = d_raw.col(j) + i;
    T* d_c = d_raw.col(j) + z + i;
    const Lane<T> d = Load(d_sample.col(j) + i, n);
    // softplus'(c) = sigmoid(c) = 1 - exp(-softplus(c)).
    const Lane<T> slope = T(1) - (min_std - Load(std.col(j) + i, n)).exp();
    Store<T>(Load(d_mean, n) + d, d_mean, n);
    Store<T>((Load(d_c, n) + d * Load(noise.col(j) + i, n)) * slope, d_c, n);
  });
}

template <typename T>
void GaussianKl(In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, Mat<T> kl) {
  const Index z = q_std.rows;
  for (Index j = 0; j < q_std.cols; ++j) {
    Lane<T> total = Lane<T>::Zero();
    for (Index i = 0; i < z; i += kLane) {
      const Index n = z - i;
      Lane<T> p = Load(p_std.col(j) + i, n);
      Lane<T> q = Load(q_std.col(j) + i, n);
      for (Index k = n; k < kLane; ++k) p[k] = q[k] = 1;
      const Lane<T> difference = (Load(q_raw.col(j) + i, n) - Load(p_raw.col(j) + i, n)) / p;
      const Lane<T> ratio = q / p;
      total += T(0.5) * (ratio.square() + difference.square() - T(1)) - ratio.log();
    }
    kl(0, j) = total.sum();
  }
}

template <typename T>
void GaussianKlBackward(In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, T min_std, In<T> weight,
                        T q_factor, T p_factor, Mat<T> d_q, Mat<T> d_p) {
  const Index z = q_std.rows;
  ForLanes(z, q_std.cols, [&](Index j, Index i, Index n) {
    Lane<T> p = Load(p_std.col(j) + i, n);
    Lane<T> q = Load(q_std.col(j) + i, n);
    for (Index k = n; k < kLane; ++k) p[k] = q[k] = 1;
    const Lane<T> difference = Load(q_raw.col(j) + i, n) - Load(p_raw.col(j) + i, n);
    const Lane<T> inverse = T(1) / p;
    const Lane<T> d_mean = weight(0, j) * difference * inverse.square();
    const Lane<T> d_std_q = weight(0, j) * (q * inverse.square() - T(1) / q);
    const Lane<T> d_std_p =
        weight(0, j) * inverse * (T(1) - (q.square() + difference.square()) * inverse.square());
    Store<T>(q_factor * d_mean, d_q.col(j) + i, n);
    Store<T>(q_factor * d_std_q, d_q.col(j) + z + i, n);
    Store<T>(-p_factor * d_mean, d_p.col(j) + i, n);
    Store<T>(p_factor * d_std_p * (T(1) - (min_std - p).exp()), d_p.col(j) + z + i, n);
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
  ForLanes(y.rows, y.cols, [&](Index j, Index i, Index n) {
    Store<T>(Sigmoid<T>(Load(x.col(j) + i, n)), y.col(j) + i, n);
  });
}

template <typename T>
void ActorForward(In<T> raw, In<T> noise, const ActorShape& shape, Mat<T> squashed, Mat<T> std,
                  Mat<T> action, Mat<T> entropy) {
  const Index a = action.rows;
  // Actions are short, so the columns are laid end to end before the lanes run.
  for (Index j = 0; j < action.cols; ++j) {
    for (Index i = 0; i < a; ++i) {
      squashed(i, j) = raw(i, j);
      std(i, j) = raw(a + i, j);
    }
  }
  const T limit = static_cast<T>(shape.mean_limit);
  const T offset = static_cast<T>(shape.std_offset);
  const T min_std = static_cast<T>(shape.min_std);
  const Index total = action.size();
  if (entropy) SetZero(entropy);
  for (Index i = 0; i < total; i += kLane) {
    const Index n = total - i;
    const Lane<T> t = (Load(squashed.data + i, n) / limit).tanh();
    const Lane<T> s = Softplus<T>(Load(std.data + i, n) + offset) + min_std;
    Store<T>(t, squashed.data + i, n);
    Store<T>(s, std.data + i, n);
    if (!noise) {
      Store<T>((limit * t).tanh(), action.data + i, n);
      continue;
    }
    const Lane<T> eps = Load(noise.data + i, n);
    const Lane<T> u = limit * t + s * eps;
    Store<T>(u.tanh(), action.data + i, n);
    if (!entropy) continue;
    // - ln p(a) = ln std + eps^2 / 2 + ln(2 pi) / 2 + ln(1 - tanh(u)^2), the
    // last as 2 (ln 2 - u - softplus(-2u)), which never takes the log of 0.
    const T log_two = std::numbers::ln2_v<T>;
    const Lane<T> e = s.log() + T(0.5) * eps.square() + static_cast<T>(kHalfLogTwoPi) +
                      T(2) * (log_two - u - Softplus<T>(T(-2) * u));
    for (Index k = 0; k < std::min<Index>(n, kLane); ++k) entropy(0, (i + k) / a) += e[k];
  }
}

template <typename T>
void ActorBackward(In<T> squashed, In<T> std, In<T> action, In<T> noise, const ActorShape& shape,
                   In<T> d_action, In<T> entropy_weight, Mat<T> d_raw) {
  const Index a = action.rows;
  const T min_std = static_cast<T>(shape.min_std);
  for (Index j = 0; j < action.cols; ++j) {
    const T weight = entropy_weight(0, j);
    for (Index i = 0; i < a; ++i) {
      const T y = action(i, j);
      const T du = d_action(i, j) * (T(1) - y * y) - T(2) * weight * y;
      const T t = squashed(i, j);
      d_raw(i, j) = du * (T(1) - t * t);
      d_raw(a + i, j) =
          (du * noise(i, j) + weight / std(i, j)) * (T(1) - std::exp(min_std - std(i, j)));
    }
  }
}

template <typename T>
void ApplyAdam(const AdamStep& step, Index count, const T* gradient, T* first, T* second,
               T* value) {
  const T factor = static_cast<T>(step.factor);
  const T beta1 = static_cast<T>(step.beta1);
  const T beta2 = static_cast<T>(step.beta2);
  const T epsilon = static_cast<T>(step.epsilon);
  const T rate = static_cast<T>(step.learning_rate * step.rate1);
  const T rate2 = static_cast<T>(step.rate2);
  for (Index i = 0; i < count; i += kLane) {
    const Index n = count - i;
    const Lane<T> g = Load(gradient + i, n) * factor;
    const Lane<T> m = beta1 * Load(first + i, n) + (T(1) - beta1) * g;
    const Lane<T> v = beta2 * Load(second + i, n) + (T(1) - beta2) * g.square();
    Store<T>(m, first + i, n);
    Store<T>(v, second + i, n);
    Store<T>(Load(value + i, n) - rate * m / ((v * rate2).sqrt() + epsilon), value + i, n);
  }
}

template <typename T>
double SumOfSquares(const T* x, Index count) {
  Eigen::Array<double, kLane, 1> total = Eigen::Array<double, kLane, 1>::Zero();
  for (Index i = 0; i < count; i += kLane) {
    total += Load(x + i, count - i).template cast<double>().square();
  }
  return total.sum();
}

template <typename T>
void MoveTowards(const T* fast, T rate, Index count, T* slow) {
  for (Index i = 0; i < count; ++i) slow[i] += rate * (fast[i] - slow[i]);
}

#define DREAMER_INSTANTIATE(T)                                                                     \
  template void FillColumns<T>(const T*, Mat<T>);                                                  \
  template void Add<T>(In<T>, Mat<T>);                                                             \
  template void AddColumnSums<T>(In<T>, T*);                                                       \
  template void Elu<T>(Mat<T>);                                                                    \
  template void EluBackward<T>(In<T>, Mat<T>);                                                     \
  template void LayerNormElu<T>(const T*, const T*, Mat<T>, Mat<T>, Mat<T>);                       \
  template void LayerNormEluBackward<T>(const T*, In<T>, In<T>, In<T>, Mat<T>, T*, T*);            \
  template void GruForward<T>(In<T>, In<T>, In<T>, Mat<T>, Mat<T>);                                \
  template void GruBackward<T>(In<T>, In<T>, In<T>, Mat<T>, Mat<T>, Mat<T>);                       \
  template void GaussianForward<T>(In<T>, In<T>, T, Mat<T>, Mat<T>);                               \
  template void GaussianBackward<T>(In<T>, In<T>, T, In<T>, Mat<T>);                               \
  template void GaussianKl<T>(In<T>, In<T>, In<T>, In<T>, Mat<T>);                                 \
  template void GaussianKlBackward<T>(In<T>, In<T>, In<T>, In<T>, T, In<T>, T, T, Mat<T>, Mat<T>); \
  template double SquaredError<T>(In<T>, In<T>, T, Mat<T>);                                        \
  template double BernoulliError<T>(In<T>, In<T>, T, Mat<T>);                                      \
  template void Sigmoid<T>(In<T>, Mat<T>);                                                         \
  template void ActorForward<T>(In<T>, In<T>, const ActorShape&, Mat<T>, Mat<T>, Mat<T>, Mat<T>);  \
  template void ActorBackward<T>(In<T>, In<T>, In<T>, In<T>, const ActorShape&, In<T>, In<T>,      \
                                 Mat<T>);                                                          \
  template void ApplyAdam<T>(const AdamStep&, Index, const T*, T*, T*, T*);                        \
  template double SumOfSquares<T>(const T*, Index);                                                \
  template void MoveTowards<T>(const T*, T, Index, T*);
DREAMER_INSTANTIATE(float)
DREAMER_INSTANTIATE(double)
#undef DREAMER_INSTANTIATE

}  // namespace dreamsearch::networks
