#include <algorithm>
#include <ctime>
#include <vector>

#include "dreamsearch/instruction_set.h"
#include "host/processes/eigen_product.h"

namespace dreamsearch {

void EigenBaseline(const float*, const float*, float*, std::int64_t, std::int64_t, std::int64_t);
void EigenAvx2(const float*, const float*, float*, std::int64_t, std::int64_t, std::int64_t);
void EigenAvx512(const float*, const float*, float*, std::int64_t, std::int64_t, std::int64_t);

EigenProduct ChosenEigenProduct() {
  const InstructionSet set = ChosenInstructionSet();
  return set >= InstructionSet::kAvx512 ? EigenAvx512
         : set == InstructionSet::kAvx2 ? EigenAvx2
                                        : EigenBaseline;
}

double MeasureGflopPerSecond() {
  constexpr std::int64_t kSize = 512;
  // Not zeros: some processors are faster on those.
  const std::vector<float> a(kSize * kSize, 0.5f), b(kSize * kSize, -1.5f);
  std::vector<float> c(kSize * kSize);
  const EigenProduct multiply = ChosenEigenProduct();
  const auto seconds = [] {
    std::timespec time{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  double best = 1e9;
  for (int i = 0; i < 6; ++i) {
    const double begin = seconds();
    multiply(a.data(), b.data(), c.data(), kSize, kSize, kSize);
    best = std::min(best, seconds() - begin);
  }
  return 2e-9 * kSize * kSize * kSize / best;
}

}  // namespace dreamsearch
