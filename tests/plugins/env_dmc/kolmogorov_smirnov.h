// kolmogorov_smirnov.h - tests whether two samples have one distribution.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace dreamsearch::dmc {

// The probability that two samples of n and m values of one distribution are at
// least `distance` apart (largest difference of the distribution functions).
// Asymptotic series with Stephens' (1970) correction for small samples.
inline double KolmogorovSmirnovP(double distance, double n, double m) {
  const double root = std::sqrt(n * m / (n + m));
  const double lambda = (root + 0.12 + 0.11 / root) * distance;
  if (lambda < 0.2) return 1;  // where the series converges slowly, to 1
  double p = 0;
  for (int k = 1; k <= 100; ++k) {
    p += (k % 2 == 1 ? 2 : -2) * std::exp(-2.0 * k * k * lambda * lambda);
  }
  return std::clamp(p, 0.0, 1.0);
}

// The largest difference of the two samples' distribution functions.
inline double KolmogorovSmirnovDistance(std::vector<double> a, std::vector<double> b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  double largest = 0;
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    const double x = std::min(a[i], b[j]);
    while (i < a.size() && a[i] <= x) ++i;
    while (j < b.size() && b[j] <= x) ++j;
    largest = std::max(largest, std::abs(static_cast<double>(i) / static_cast<double>(a.size()) -
                                         static_cast<double>(j) / static_cast<double>(b.size())));
  }
  return largest;
}

}  // namespace dreamsearch::dmc
