// yardstick.h - large matrix products by libraries made for them, with the instruction set
// that our kernels use, on one thread: what this processor can do.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace dreamsearch {

// A library's product c = a b of column-major matrices: c [m, n], a [m, k], b [k, n].
struct LibraryProduct {
  std::string name;
  std::function<void(const float* a, const float* b, float* c, std::int64_t m, std::int64_t n,
                     std::int64_t k)>
      multiply;
};

// Those that were found when this was built: Eigen always, oneDNN and libxsmm if installed.
// Call it first in main: it restarts the program with one OpenMP thread, which libraries
// read when they are loaded.
const std::vector<LibraryProduct>& LibraryProducts(char** argv);

// Floating-point operations a processor second of the best of ten products of 1024 x 1024 x
// 1024 by the faster of Eigen and oneDNN; *name says which. Measured at the first call.
double MachineLimit(std::string* name = nullptr);

}  // namespace dreamsearch
