// In a file of its own: Boost.Math takes long to compile.
#include <boost/math/distributions/students_t.hpp>

#include "results/statistics/statistics.h"

namespace dreamsearch::results {

double StudentQuantile(double q, int degrees_of_freedom) {
  return boost::math::quantile(boost::math::students_t(degrees_of_freedom), q);
}

}  // namespace dreamsearch::results
