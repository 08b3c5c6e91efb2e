// The products of a layer, in float and rounded to bfloat16, against sums in double, and
// the law that a column's bits do not depend on its neighbours.
#include "plugins/networks/product.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "dreamsearch/random.h"
#include "plugins/networks/bfloat16.h"

namespace dreamsearch::networks {
namespace {

using F = Mat<float>;

std::vector<float> Normals(Random* random, Index count) {
  std::vector<float> values(static_cast<std::size_t>(count));
  for (float& v : values) v = static_cast<float>(random->Normal());
  return values;
}

// Multiples of 1/16 up to 2, which bfloat16 holds exactly. Sums of some thousand products
// are exact in float, in any order.
std::vector<float> Exact(Random* random, Index count) {
  std::vector<float> values(static_cast<std::size_t>(count));
  for (float& v : values) v = static_cast<float>(random->Below(65)) / 16 - 2;
  return values;
}

// c(i, j) += the sum over k of a(i, k) b(k, j).
template <typename A, typename B>
void AddExpected(Index rows, Index cols, Index depth, A a, B b, Mat<float> c) {
  for (Index j = 0; j < cols; ++j) {
    for (Index i = 0; i < rows; ++i) {
      double sum = static_cast<double>(c(i, j));
      for (Index k = 0; k < depth; ++k) {
        sum += static_cast<double>(a(i, k)) * static_cast<double>(b(k, j));
      }
      c(i, j) = static_cast<float>(sum);
    }
  }
}

// The five products of one implementation, for one weight.
struct Products {
  std::function<void(F x, F y)> add;
  std::function<void(F dy, F dx)> add_transposed;
  std::function<void(const float* bias, F x, F y)> set;
  std::function<void(F dy, F dx)> set_transposed;
  std::function<void(F dy, F x, F dw)> add_outer;
};

void ExpectSumsInDouble(Index out, Index in, Index n, Index gap, F w, const Products& products,
                        Random* random) {
  SCOPED_TRACE(testing::Message() << out << " x " << in << ", " << n << " columns, gap " << gap);
  std::vector<float> x = Exact(random, (in + gap) * n), d = Exact(random, (out + gap) * n);
  const F mx(x.data(), in, n, in + gap), md(d.data(), out, n, out + gap);
  std::vector<float> bias = Exact(random, out + kBiasOverrun);
  const auto y = [&](std::vector<float>& memory) { return F(memory.data(), out, n, out + gap); };
  const auto dx = [&](std::vector<float>& memory) { return F(memory.data(), in, n, in + gap); };
  const auto transposed = [](F m) { return [m](Index i, Index k) { return m(k, i); }; };

  std::vector<float> found = Exact(random, (out + gap) * n), expected = found;
  products.add(mx, y(found));
  AddExpected(out, n, in, w, mx, y(expected));
  EXPECT_EQ(found, expected) << "y += w x";

  products.set(bias.data(), mx, y(found));
  for (Index j = 0; j < n; ++j) std::copy(bias.begin(), bias.begin() + out, y(expected).col(j));
  AddExpected(out, n, in, w, mx, y(expected));
  EXPECT_EQ(found, expected) << "y = w x + bias";

  found = expected = Exact(random, (in + gap) * n);
  products.add_transposed(md, dx(found));
  AddExpected(in, n, out, transposed(w), md, dx(expected));
  EXPECT_EQ(found, expected) << "dx += w^T dy";

  products.set_transposed(md, dx(found));
  SetZero(dx(expected));
  AddExpected(in, n, out, transposed(w), md, dx(expected));
  EXPECT_EQ(found, expected) << "dx = w^T dy";

  found = expected = Exact(random, (out + gap) * in);
  products.add_outer(md, mx, F(found.data(), out, in, out + gap));
  AddExpected(out, in, n, md, transposed(mx), F(expected.data(), out, in, out + gap));
  EXPECT_EQ(found, expected) << "dw += dy x^T";
}

TEST(Product, EqualsSumsInDoubleAtEverySizeOfItsPaths) {
  Random random(5);
  for (const Index out : {1, 7, 8, 17, 48, 64, 65, 200}) {
    for (const Index in : {1, 2, 6, 19, 37, 128}) {
      for (const Index n : {1, 2, 3, 4, 5, 6, 7, 11, 16, 47, 48, 49, 129, 300}) {
        for (const Index gap : {0, 3}) {
          std::vector<float> group = Exact(&random, 3 + out * (in + 5));
          PackedWeights<float> packed({{0, 1, 0, 1}, {3, out, 5, in}});
          packed.Pack(group.data());
          const F w(group.data() + 3 + 5 * out, out, in);
          ExpectSumsInDouble(
              out, in, n, gap, w,
              {[&](F x, F y) { packed.AddProduct(1, x, y); },
               [&](F dy, F dx) { packed.AddTransposedProduct(1, dy, dx); },
               [&](const float* bias, F x, F y) { packed.SetProduct(1, bias, x, y); },
               [&](F dy, F dx) { packed.SetTransposedProduct(1, dy, dx); },
               [&](F dy, F x, F dw) { AddOuterProduct<float>(dy, x, dw); }},
              &random);
          if (testing::Test::HasFailure()) return;
        }
      }
    }
  }
}

TEST(Product, RoundedEqualsSumsInDoubleOfExactFactors) {
  if (!Bfloat16Available()) GTEST_SKIP() << "no bfloat16 in the instruction set in use";
  Random random(3);
  for (const Index out : {1, 16, 30, 200}) {
    for (const Index in : {1, 6, 32, 37, 230}) {
      for (const Index n : {1, 2, 3, 4, 16, 17, 33, 65, 300}) {
        for (const Index gap : {0, 3}) {
          std::vector<float> group = Exact(&random, 3 + out * (in + 5));
          Bfloat16Weights rounded({{0, 1, 0, 1}, {3, out, 5, in}});
          Bfloat16Scratch scratch;
          rounded.Pack(group.data());
          const F w(group.data() + 3 + 5 * out, out, in);
          ExpectSumsInDouble(
              out, in, n, gap, w,
              {[&](F x, F y) { rounded.AddProduct(1, x, y, &scratch); },
               [&](F dy, F dx) { rounded.AddTransposedProduct(1, dy, dx, &scratch); },
               [&](const float* bias, F x, F y) { rounded.SetProduct(1, bias, x, y, &scratch); },
               [&](F dy, F dx) { rounded.SetTransposedProduct(1, dy, dx, &scratch); },
               [&](F dy, F x, F dw) { AddRoundedOuterProduct(dy, x, dw, &scratch); }},
              &random);
          if (testing::Test::HasFailure()) return;
        }
      }
    }
  }
}

// Every column of a product of n columns has the bits of the product of it alone.
template <typename Multiply>
void ExpectColumnsAlone(Index out, Index in, Multiply multiply) {
  Random random(7);
  constexpr Index kMost = 512;
  const std::vector<float> x = Normals(&random, in * kMost);
  std::vector<float> alone(static_cast<std::size_t>(out * kMost)), together(alone.size());
  for (Index j = 0; j < kMost; ++j) {
    multiply(Mat<const float>(x.data() + j * in, in, 1), F(alone.data() + j * out, out, 1));
  }
  for (Index n = 1; n <= kMost; n += n < 70 ? 1 : 13) {
    // The columns end where the memory does, so that places differ from call to call.
    const Index first = kMost - n;
    multiply(Mat<const float>(x.data() + first * in, in, n),
             F(together.data() + first * out, out, n));
    ASSERT_TRUE(
        std::equal(together.begin() + first * out, together.end(), alone.begin() + first * out))
        << out << " x " << in << ", " << n << " columns";
  }
}

TEST(Product, AColumnHasTheSameBitsWhateverStandsBesideIt) {
  for (const Index out : {1, 5, 32, 64, 128, 144, 200, 208, 400}) {
    for (const Index in : {1, 24, 160, 230}) {
      Random random(11);
      const std::vector<float> w = Normals(&random, out * in);
      PackedWeights<float> packed({{0, out, 0, in}});
      packed.Pack(w.data());
      const std::vector<float> bias = Normals(&random, out);
      ExpectColumnsAlone(out, in,
                         [&](Mat<const float> x, F y) { packed.SetProduct(0, bias.data(), x, y); });
      ExpectColumnsAlone(
          in, out, [&](Mat<const float> dy, F dx) { packed.SetTransposedProduct(0, dy, dx); });
    }
  }
}

TEST(Product, ARoundedColumnHasTheSameBitsWhateverStandsBesideIt) {
  if (!Bfloat16Available()) GTEST_SKIP() << "no bfloat16 in the instruction set in use";
  for (const Index out : {1, 5, 32, 128, 200}) {
    for (const Index in : {1, 24, 160, 230}) {
      Random random(11);
      const std::vector<float> w = Normals(&random, out * in);
      Bfloat16Weights rounded({{0, out, 0, in}});
      Bfloat16Scratch scratch;
      rounded.Pack(w.data());
      const std::vector<float> bias = Normals(&random, out + kBiasOverrun);
      ExpectColumnsAlone(out, in, [&](Mat<const float> x, F y) {
        rounded.SetProduct(0, bias.data(), x, y, &scratch);
      });
    }
  }
}

}  // namespace
}  // namespace dreamsearch::networks
