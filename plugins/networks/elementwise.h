// elementwise.h - everything of a layer that is not a matrix product.
//
// Forward kernels keep what their backward kernels need. Written once on vectors of any
// length and compiled for every instruction set (dispatch.h). NaN in an input is NaN in
// the output.
#pragma once

#include <type_traits>

#include "plugins/networks/matrix.h"

namespace dreamsearch::networks {

template <typename T>
using In = Mat<const std::type_identity_t<T>>;

// y[:, j] = bias, for every column.
template <typename T>
void FillColumns(const T* bias, Mat<T> y);

// y += x.
template <typename T>
void Add(In<T> x, Mat<T> y);

// sum[i] += the sum over the columns of d[i, :].
template <typename T>
void AddColumnSums(In<T> d, T* sum);

// elu(x) = x for x > 0, exp(x) - 1 below, in place.
template <typename T>
void Elu(Mat<T> x);

// d *= elu'(x), from y = elu(x): 1 for y > 0, y + 1 below.
template <typename T>
void EluBackward(In<T> y, Mat<T> d);

// f of layer normalisation (Ba, Kiros, Hinton 2016), in place: x becomes
// f(scale * unit + shift), unit = (x - mean) / sqrt(variance + 1e-5) over the rows.
// unit: as x; inverse: [1, n], 1 / sqrt(variance + 1e-5). f is the identity, elu, or
// mish(x) = x tanh(ln(1 + exp(x))) (Misra 2020).
enum class AfterNorm { kNothing, kElu, kMish };
template <typename T>
void LayerNorm(AfterNorm after, const T* scale, const T* shift, Mat<T> x, Mat<T> unit,
               Mat<T> inverse);

// d, the gradient of the output y, becomes that of the input, in place; d_scale and
// d_shift are added to, unless null.
template <typename T>
void LayerNormBackward(AfterNorm after, const T* scale, const T* shift, In<T> unit, In<T> inverse,
                       In<T> y, Mat<T> d, T* d_scale, T* d_shift);

// The gates of a GRU cell in torch's form: with (i_r, i_u, i_n) = input and
// (h_r, h_u, h_n) = recurrent, both [3D, n],
//   r = sigmoid(i_r + h_r)   u = sigmoid(i_u + h_u)   c = tanh(i_n + r * h_n)
//   next = (1 - u) * c + u * previous
// gates: [4D, n], receives r, u, c, h_n.
template <typename T>
void GruForward(In<T> input, In<T> recurrent, In<T> previous, Mat<T> gates, Mat<T> next);

// From d_next: d_input and d_recurrent [3D, n]; d_previous gets u * d_next, the
// direct path only.
template <typename T>
void GruBackward(In<T> gates, In<T> previous, In<T> d_next, Mat<T> d_input, Mat<T> d_recurrent,
                 Mat<T> d_previous);

// A diagonal Gaussian from raw = (mean, c), both Z rows: std = softplus(c) +
// min_std. sample = mean + std * noise; the mean where noise is empty.
template <typename T>
void GaussianForward(In<T> raw, In<T> noise, T min_std, Mat<T> std, Mat<T> sample);

// d_raw holds the gradients of (mean, std) from elsewhere and becomes those of
// (mean, c), with d_sample's added.
template <typename T>
void GaussianBackward(In<T> std, In<T> noise, T min_std, In<T> d_sample, Mat<T> d_raw);

// The KL divergence of q from p, summed over the rows, one for each column. The
// means are the first rows of raw. kl: [1, n].
template <typename T>
void GaussianKl(In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, Mat<T> kl);

// Its gradient times weight[0, j]: d_q, of (mean, std) of q, times q_factor; d_p,
// of (mean, c) of p, times p_factor.
template <typename T>
void GaussianKlBackward(In<T> q_raw, In<T> q_std, In<T> p_raw, In<T> p_std, T min_std, In<T> weight,
                        T q_factor, T p_factor, Mat<T> d_q, Mat<T> d_p);

// Returns the sum of 0.5 * (prediction - target)^2; d = factor * (prediction -
// target).
template <typename T>
double SquaredError(In<T> prediction, In<T> target, T factor, Mat<T> d);

// Returns the sum of the cross-entropies of Bernoulli(sigmoid(logit)) from
// target; d = factor * (sigmoid(logit) - target).
template <typename T>
double BernoulliError(In<T> logit, In<T> target, T factor, Mat<T> d);

// y = sigmoid(x).
template <typename T>
void Sigmoid(In<T> x, Mat<T> y);

// The inverse of tanh, in place; the numbers lie between -1 and 1.
template <typename T>
void Atanh(Mat<T> x);

// The actor's distribution: from raw = (m, c), A rows each,
//   mean = limit * tanh(m / limit)   std = softplus(c + offset) + min_std
// or, with bounds on ln std,
//   mean = m   ln std = min_log_std + (max_log_std - min_log_std) (tanh(c) + 1) / 2
// and then action = tanh(mean + std * noise).
struct ActorShape {
  double mean_limit = 5;
  double std_offset = 0;
  double min_std = 1e-4;
  double min_log_std = 0;  // both 0: no such bounds
  double max_log_std = 0;
  bool bounds_log_std() const { return min_log_std < max_log_std; }
  double log_std_reach() const { return 0.5 * (max_log_std - min_log_std); }
};

// squashed = tanh(m / limit) or m, std, action: [A, n], dense. noise: [A, n]; empty
// for the mode, tanh(mean). entropy: [1, n], receives - ln p(action) of the density
// of the squashed action; may be empty.
template <typename T>
void ActorForward(In<T> raw, In<T> noise, const ActorShape& shape, Mat<T> squashed, Mat<T> std,
                  Mat<T> action, Mat<T> entropy);

// d_raw from d_action, from entropy_weight[0, j], the gradient of each column's - ln p(action),
// and from d_gaussian: [2 A, n], the gradients of the means, then of the deviations, that come
// from elsewhere; may be empty.
template <typename T>
void ActorBackward(In<T> squashed, In<T> std, In<T> action, In<T> noise, const ActorShape& shape,
                   In<T> d_action, In<T> entropy_weight, In<T> d_gaussian, Mat<T> d_raw);

// One Adam step (Kingma, Ba 2015) on `count` parameters, the gradient times
// `factor` first. rate1, rate2: 1 / (1 - beta^step), the bias corrections.
struct AdamStep {
  double learning_rate = 0;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-7;
  double factor = 1;
  double rate1 = 1;
  double rate2 = 1;
};
template <typename T>
void ApplyAdam(const AdamStep& step, Index count, const T* gradient, T* first, T* second, T* value);

// The sum of squares, accumulated in double in a fixed order.
template <typename T>
double SumOfSquares(const T* x, Index count);

// slow += rate * (fast - slow).
template <typename T>
void MoveTowards(const T* fast, T rate, Index count, T* slow);

}  // namespace dreamsearch::networks
