#include "tests/benchmark/yardstick.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <ctime>
#ifdef DREAMSEARCH_HAVE_ONEDNN
#include <oneapi/dnnl/dnnl.h>
#endif
#ifdef DREAMSEARCH_HAVE_LIBXSMM
#include <libxsmm.h>
#endif

#include "dreamsearch/instruction_set.h"
#include "dreamsearch/random.h"
#include "host/processes/eigen_product.h"

namespace dreamsearch {

namespace {

std::vector<LibraryProduct>& Products() {
  static std::vector<LibraryProduct> products;
  return products;
}

double ThreadSeconds() {
  std::timespec time;
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

std::vector<LibraryProduct> FindProducts() {
  std::vector<LibraryProduct> products;
  const InstructionSet set = ChosenInstructionSet();
  products.push_back({"Eigen", ChosenEigenProduct()});
#ifdef DREAMSEARCH_HAVE_ONEDNN
  dnnl_set_max_cpu_isa(set >= InstructionSet::kAvx512 ? dnnl_cpu_isa_all
                       : set == InstructionSet::kAvx2 ? dnnl_cpu_isa_avx2
                                                      : dnnl_cpu_isa_sse41);
  products.push_back({"oneDNN", [](const float* a, const float* b, float* c, std::int64_t m,
                                   std::int64_t n, std::int64_t k) {
                        // dnnl_sgemm takes row-major matrices: c^T = b^T a^T.
                        dnnl_sgemm('N', 'N', n, m, k, 1, b, k, a, m, 0, c, m);
                      }});
#endif
#ifdef DREAMSEARCH_HAVE_LIBXSMM
  libxsmm_init();
  libxsmm_set_target_archid(set >= InstructionSet::kAvx512 ? LIBXSMM_X86_AVX512_CORE
                            : set == InstructionSet::kAvx2 ? LIBXSMM_X86_AVX2
                                                           : LIBXSMM_X86_SSE3);
  products.push_back({"libxsmm", [](const float* a, const float* b, float* c, std::int64_t m,
                                    std::int64_t n, std::int64_t k) {
                        // Its kernel of this shape, made at the first call.
                        const auto rows = static_cast<libxsmm_blasint>(m);
                        const auto columns = static_cast<libxsmm_blasint>(n);
                        const auto depth = static_cast<libxsmm_blasint>(k);
                        const float alpha = 1, beta = 0;
                        const libxsmm_smmfunction kernel =
                            libxsmm_smmdispatch(rows, columns, depth, &rows, &depth, &rows, &alpha,
                                                &beta, nullptr, nullptr);
                        if (kernel != nullptr) kernel(a, b, c);
                      }});
#endif
  return products;
}

}  // namespace

const std::vector<LibraryProduct>& LibraryProducts(char** argv) {
  const char* threads = std::getenv("OMP_NUM_THREADS");
  if (threads == nullptr || std::strcmp(threads, "1") != 0) {
    ::setenv("OMP_NUM_THREADS", "1", 1);
    ::execv("/proc/self/exe", argv);
  }
  Products() = FindProducts();
  return Products();
}

double MachineLimit(std::string* name) {
  static std::string fastest;
  static const double limit = [] {
    constexpr std::int64_t kSize = 1024;
    Random random(1);
    std::vector<float> a(kSize * kSize), b(a.size()), c(a.size());
    for (float& v : a) v = static_cast<float>(random.Uniform(-1, 1));
    for (float& v : b) v = static_cast<float>(random.Uniform(-1, 1));
    double best = 1e9;
    for (int i = 0; i < 10; ++i) {
      for (const LibraryProduct& product : Products()) {
        if (product.name != "Eigen" && product.name != "oneDNN") continue;
        const double begin = ThreadSeconds();
        product.multiply(a.data(), b.data(), c.data(), kSize, kSize, kSize);
        const double seconds = ThreadSeconds() - begin;
        if (seconds < best) {
          best = seconds;
          fastest = product.name;
        }
      }
    }
    return 2.0 * kSize * kSize * kSize / best;
  }();
  if (name != nullptr) *name = fastest;
  return limit;
}

}  // namespace dreamsearch
