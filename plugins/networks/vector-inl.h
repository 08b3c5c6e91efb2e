// vector-inl.h - loads and stores of any length, and the functions that activations are
// made of, for the instruction set that is being compiled. Include it in a file with
// kernels (see dispatch.h), after foreach_target.h.
//
// NaN in an argument is NaN in the result, which Highway's own functions do not promise.

// Included once for each set, so no #pragma once.
#if defined(DREAMSEARCH_NETWORKS_VECTOR_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef DREAMSEARCH_NETWORKS_VECTOR_INL
#undef DREAMSEARCH_NETWORKS_VECTOR_INL
#else
#define DREAMSEARCH_NETWORKS_VECTOR_INL
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cstdint>
#include <numbers>

HWY_BEFORE_NAMESPACE();
namespace dreamsearch::networks {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <typename T>
using Tag = hn::ScalableTag<T>;
template <typename T>
using Vector = hn::Vec<Tag<T>>;

// Up to a register of consecutive values, zero beyond `n`; reads no others.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE hn::Vec<D> LoadUpTo(D d, const T* p, std::int64_t n) {
  const auto lanes = static_cast<std::int64_t>(hn::Lanes(d));
  if (n >= lanes) return hn::LoadU(d, p);
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
  return hn::MaskedLoad(hn::FirstN(d, n > 0 ? static_cast<std::size_t>(n) : 0), d, p);
#else
  HWY_ALIGN T values[HWY_LANES(T)] = {};
  for (std::int64_t i = 0; i < n; ++i) values[i] = p[i];
  return hn::Load(d, values);
#endif
}

// Writes the first `n` values, at most a register.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void StoreUpTo(hn::Vec<D> v, D d, T* p, std::int64_t n) {
  const auto lanes = static_cast<std::int64_t>(hn::Lanes(d));
  if (n >= lanes) {
    hn::StoreU(v, d, p);
  } else if (n > 0) {
    hn::BlendedStore(v, hn::FirstN(d, static_cast<std::size_t>(n)), d, p);
  }
}

template <typename T>
HWY_INLINE Vector<T> Constant(double value) {
  return hn::Set(Tag<T>(), static_cast<T>(value));
}

// max(low, x) and min(high, x), and x where it is NaN: of two values that cannot be compared
// x86 takes the second.
template <class V>
HWY_INLINE V AtLeast(V low, V x) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
  return hn::Max(low, x);
#else
  return hn::IfThenElse(hn::Lt(x, low), low, x);
#endif
}
template <class V>
HWY_INLINE V AtMost(V high, V x) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
  return hn::Min(high, x);
#else
  return hn::IfThenElse(hn::Gt(x, high), high, x);
#endif
}
template <class V>
HWY_INLINE V Positive(V x) {
  return AtLeast(hn::Zero(hn::DFromV<V>()), x);
}
template <class V>
HWY_INLINE V Negative(V x) {
  return AtMost(hn::Zero(hn::DFromV<V>()), x);
}

// exp(x): x = n ln 2 + r with |r| <= ln 2 / 2 and exp(x) = 2^n exp(r), the second factor
// by its series, to the type's rounding. ln 2 comes in two parts, the first short enough
// that n times it is exact. Arguments are bounded so that the result is a normal number.
HWY_INLINE Vector<float> Exp(Vector<float> x) {
  const Tag<float> d;
  const Tag<std::int32_t> di;
  x = AtMost(Constant<float>(88), AtLeast(Constant<float>(-87), x));
  const auto n = hn::Round(hn::Mul(x, Constant<float>(std::numbers::log2e)));
  auto r = hn::NegMulAdd(n, Constant<float>(0.693359375), x);
  r = hn::NegMulAdd(n, Constant<float>(-2.12194440e-4), r);
  auto sum = Constant<float>(1.0 / 5040);
  sum = hn::MulAdd(sum, r, Constant<float>(1.0 / 720));
  sum = hn::MulAdd(sum, r, Constant<float>(1.0 / 120));
  sum = hn::MulAdd(sum, r, Constant<float>(1.0 / 24));
  sum = hn::MulAdd(sum, r, Constant<float>(1.0 / 6));
  sum = hn::MulAdd(sum, r, Constant<float>(0.5));
  sum = hn::MulAdd(sum, r, Constant<float>(1));
  sum = hn::MulAdd(sum, r, Constant<float>(1));
  const auto exponent = hn::Add(hn::ConvertTo(di, n), hn::Set(di, 127));
  return hn::Mul(sum, hn::BitCast(d, hn::ShiftLeft<23>(exponent)));
}
HWY_INLINE Vector<double> Exp(Vector<double> x) {
  const Tag<double> d;
  const Tag<std::int64_t> di;
  x = AtMost(Constant<double>(709), AtLeast(Constant<double>(-708), x));
  const auto n = hn::Round(hn::Mul(x, Constant<double>(std::numbers::log2e)));
  auto r = hn::NegMulAdd(n, Constant<double>(0x1.62e42fefap-1), x);
  r = hn::NegMulAdd(n, Constant<double>(0x1.cf79abc9e3b3ap-40), r);
  double factorial = 6227020800;  // 13!
  auto sum = Constant<double>(1 / factorial);
  for (int i = 13; i > 0; --i) {
    factorial /= i;
    sum = hn::MulAdd(sum, r, Constant<double>(1 / factorial));
  }
  // The integer n from the low bits of a sum with 3 * 2^51.
  const auto shift = Constant<double>(0x1.8p52);
  const auto integer = hn::Sub(hn::BitCast(di, hn::Add(n, shift)), hn::BitCast(di, shift));
  const auto exponent = hn::Add(integer, hn::Set(di, 1023));
  return hn::Mul(sum, hn::BitCast(d, hn::ShiftLeft<52>(exponent)));
}

// tanh(x). For float a quotient of polynomials in x^2, fitted to the least relative error
// between -9 and 9 (7e-9 in exact arithmetic).
HWY_INLINE Vector<float> Tanh(Vector<float> x) {
  x = AtMost(Constant<float>(9), AtLeast(Constant<float>(-9), x));
  const auto u = hn::Mul(x, x);
  auto p = Constant<float>(-8.43612e-14);
  p = hn::MulAdd(p, u, Constant<float>(5.257808e-11));
  p = hn::MulAdd(p, u, Constant<float>(-2.0184027e-08));
  p = hn::MulAdd(p, u, Constant<float>(1.11442705e-05));
  p = hn::MulAdd(p, u, Constant<float>(0.0031030027));
  p = hn::MulAdd(p, u, Constant<float>(0.13083158));
  p = hn::MulAdd(p, u, Constant<float>(1));
  auto q = Constant<float>(0.0002544753);
  q = hn::MulAdd(q, u, Constant<float>(0.024491386));
  q = hn::MulAdd(q, u, Constant<float>(0.46416485));
  q = hn::MulAdd(q, u, Constant<float>(1));
  const auto y = hn::Div(hn::Mul(x, p), q);
  return AtMost(Constant<float>(1), AtLeast(Constant<float>(-1), y));
}
HWY_INLINE Vector<double> Tanh(Vector<double> x) {
  const auto one = Constant<double>(1);
  const auto e = Exp(hn::Mul(Constant<double>(-2), hn::Abs(x)));
  return hn::CopySign(hn::Div(hn::Sub(one, e), hn::Add(one, e)), x);
}

// 1 / (1 + exp(-x)).
template <typename T, class V = Vector<T>>
HWY_INLINE V Logistic(V x) {
  const auto one = Constant<T>(1);
  return hn::Div(one, hn::Add(one, Exp(hn::Neg(x))));
}

// ln(1 + exp(x)).
template <typename T, class V = Vector<T>>
HWY_INLINE V Softplus(V x) {
  return hn::Add(Positive(x), hn::Log1p(Tag<T>(), Exp(hn::Neg(hn::Abs(x)))));
}

// elu(x) = x for x > 0, exp(x) - 1 below.
template <typename T, class V = Vector<T>>
HWY_INLINE V EluOf(V x) {
  return hn::Add(Positive(x), hn::Sub(Exp(Negative(x)), Constant<T>(1)));
}
// elu'(x) from y = elu(x): 1 for y > 0, y + 1 below.
template <typename T, class V = Vector<T>>
HWY_INLINE V EluSlope(V y) {
  return hn::Add(Negative(y), Constant<T>(1));
}

// mish(x) = x t, t = tanh(ln(1 + exp(x))) = (e e + 2 e) / (e e + 2 e + 2) with e = exp(x);
// beyond x = 20 t is 1 in either type.
template <typename T, class V = Vector<T>>
HWY_INLINE V MishOf(V x) {
  const auto e = Exp(AtMost(Constant<T>(20), x));
  const auto n = hn::Mul(e, hn::Add(e, Constant<T>(2)));
  return hn::Mul(x, hn::Div(n, hn::Add(n, Constant<T>(2))));
}
// mish'(x) = t + x (1 - t^2) sigmoid(x).
template <typename T, class V = Vector<T>>
HWY_INLINE V MishSlope(V x) {
  const auto one = Constant<T>(1);
  const auto e = Exp(AtMost(Constant<T>(20), x));
  const auto n = hn::Mul(e, hn::Add(e, Constant<T>(2)));
  const auto t = hn::Div(n, hn::Add(n, Constant<T>(2)));
  const auto sigmoid = hn::Div(e, hn::Add(e, one));
  return hn::MulAdd(hn::Mul(x, sigmoid), hn::NegMulAdd(t, t, one), t);
}

// The sum of all lanes, in a fixed order.
template <typename T>
HWY_INLINE T SumOf(Vector<T> v) {
  return hn::GetLane(hn::SumOfLanes(Tag<T>(), v));
}

}  // namespace HWY_NAMESPACE
}  // namespace dreamsearch::networks
HWY_AFTER_NAMESPACE();

#endif
