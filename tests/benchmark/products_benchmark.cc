// Our products beside those of libraries made for them, in one process on one thread, at
// the shapes of our networks: rows x inner x columns, GFLOP/s of this thread's processor
// time.
//
//   products_benchmark
//   DREAMSEARCH_INSTRUCTION_SET=avx2 products_benchmark --benchmark_filter=/128/
//
// Ours multiplies by weights laid out beforehand, as updates and planners do; the
// libraries get the matrices as they are.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "dreamsearch/instruction_set.h"
#include "dreamsearch/random.h"
#include "plugins/networks/bfloat16.h"
#include "plugins/networks/product.h"
#include "tests/benchmark/yardstick.h"

namespace dreamsearch {
namespace {

using networks::Index;
using networks::Mat;

double Now() {
  std::timespec time;
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

std::vector<float> Draws(Index count, std::uint64_t seed) {
  Random random(seed);
  std::vector<float> values(static_cast<std::size_t>(count));
  for (float& v : values) v = static_cast<float>(random.Uniform(-1, 1));
  return values;
}

template <typename Multiply>
void Time(benchmark::State& state, Multiply multiply) {
  const Index m = state.range(0), k = state.range(1), n = state.range(2);
  const std::vector<float> a = Draws(m * k, 1), b = Draws(k * n, 2);
  std::vector<float> c(static_cast<std::size_t>(m * n));
  multiply(a.data(), b.data(), c.data());
  const double begin = Now();
  for (auto _ : state) {
    multiply(a.data(), b.data(), c.data());
    benchmark::DoNotOptimize(c.data());
    benchmark::ClobberMemory();
  }
  const double seconds = (Now() - begin) / static_cast<double>(state.iterations());
  state.counters["GFLOP/s"] =
      2e-9 * static_cast<double>(m) * static_cast<double>(k) * static_cast<double>(n) / seconds;
}

void Ours(benchmark::State& state) {
  const Index m = state.range(0), k = state.range(1), n = state.range(2);
  networks::PackedWeights<float> packed({{0, m, 0, k}});
  bool ready = false;
  Time(state, [&](const float* a, const float* b, float* c) {
    if (!ready) packed.Pack(a);
    ready = true;
    packed.SetProduct(0, a, Mat<const float>(b, k, n), Mat<float>(c, m, n));
  });
}

// The factors rounded to bfloat16, where the processor multiplies them.
void OursRounded(benchmark::State& state) {
  const Index m = state.range(0), k = state.range(1), n = state.range(2);
  networks::Bfloat16Weights packed({{0, m, 0, k}});
  networks::Bfloat16Scratch scratch;
  std::vector<float> bias(static_cast<std::size_t>(m + networks::kBiasOverrun));
  bool ready = false;
  Time(state, [&](const float* a, const float* b, float* c) {
    if (!ready) packed.Pack(a);
    ready = true;
    packed.SetProduct(0, bias.data(), Mat<const float>(b, k, n), Mat<float>(c, m, n), &scratch);
  });
}

// dw += dy x^T: here a [m, k] is dy and b, read as [n, k], is x.
void OursOuter(benchmark::State& state) {
  const Index m = state.range(0), k = state.range(1), n = state.range(2);
  Time(state, [&](const float* a, const float* b, float* c) {
    networks::AddOuterProduct<float>(Mat<const float>(a, m, k), Mat<const float>(b, n, k),
                                     Mat<float>(c, m, n));
  });
}

void OursOuterRounded(benchmark::State& state) {
  const Index m = state.range(0), k = state.range(1), n = state.range(2);
  networks::Bfloat16Scratch scratch;
  Time(state, [&](const float* a, const float* b, float* c) {
    networks::AddRoundedOuterProduct(Mat<const float>(a, m, k), Mat<const float>(b, n, k),
                                     Mat<float>(c, m, n), &scratch);
  });
}

void Shapes(benchmark::internal::Benchmark* b) {
  for (const auto& shape : std::vector<std::vector<std::int64_t>>{{128, 128, 32},
                                                                  {128, 160, 32},
                                                                  {384, 128, 32},
                                                                  {384, 128, 16},
                                                                  {200, 230, 32},
                                                                  {600, 200, 32},
                                                                  {600, 200, 50},
                                                                  {200, 200, 512},
                                                                  {128, 128, 384},
                                                                  {1024, 1024, 1024},
                                                                  {128, 160, 1},
                                                                  {128, 160, 5},
                                                                  {128, 160, 20}}) {
    b->Args(shape);
  }
  b->ArgNames({"rows", "inner", "columns"});
}

void OuterShapes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"rows", "samples", "columns"});
  b->Args({128, 512, 128})->Args({384, 512, 128})->Args({128, 384, 160})->Args({600, 480, 200});
}

}  // namespace
}  // namespace dreamsearch

int main(int argc, char** argv) {
  using namespace dreamsearch;
  for (const LibraryProduct& product : LibraryProducts(argv)) {
    benchmark::RegisterBenchmark(product.name.c_str(), [&product](benchmark::State& state) {
      Time(state, [&](const float* a, const float* b, float* c) {
        product.multiply(a, b, c, state.range(0), state.range(2), state.range(1));
      });
    })->Apply(Shapes);
  }
  benchmark::RegisterBenchmark("ours", Ours)->Apply(Shapes);
  benchmark::RegisterBenchmark("ours_outer", OursOuter)->Apply(OuterShapes);
  if (networks::Bfloat16Available()) {
    benchmark::RegisterBenchmark("ours_bfloat16", OursRounded)->Apply(Shapes);
    benchmark::RegisterBenchmark("ours_outer_bfloat16", OursOuterRounded)->Apply(OuterShapes);
  }
  std::printf("instruction set %s\n", InstructionSetName(ChosenInstructionSet()));
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
