// Compiled once for each instruction set. CMakeLists.txt renames Eigen's namespace for each, so
// that the linker keeps the copies apart.
#include <Eigen/Core>
#include <cstdint>

namespace dreamsearch {

void DREAMSEARCH_EIGEN_PRODUCT(const float* a, const float* b, float* c, std::int64_t m,
                               std::int64_t n, std::int64_t k) {
  using Matrix = Eigen::MatrixXf;
  Eigen::Map<Matrix>(c, m, n).noalias() =
      Eigen::Map<const Matrix>(a, m, k) * Eigen::Map<const Matrix>(b, k, n);
}

}  // namespace dreamsearch
