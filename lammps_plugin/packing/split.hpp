#pragma once

#include <cfloat>
#include <cmath>

#ifdef __FAST_MATH__
#error "The rests of sums need -fno-fast-math."
#endif
static_assert(FLT_EVAL_METHOD == 0, "The rests of sums need doubles that are rounded as doubles.");

namespace jamshape {

/// A number as the sum of a double and its small rest.
struct Split {
  double value, rest;
};

/// The sum of two doubles, and exactly what rounding leaves of it (Knuth, The Art of Computer
/// Programming 2, Sec. 4.2.2, Theorem B).
inline Split two_sum(double a, double b)
{
  const double sum = a + b, of_b = sum - a;
  return {sum, (a - (sum - of_b)) + (b - of_b)};
}

inline Split split(long double x)
{
  const double value = static_cast<double>(x);
  return {value, static_cast<double>(x - value)};
}

inline long double joined(const Split &x) { return static_cast<long double>(x.value) + x.rest; }

/// One coordinate of x_i - x_j, of which the leading digits cancel, as it is before it is rounded,
/// in doubles alone: j stands so many edges of the box further on.
inline Split difference(const Split &i, const Split &j, const Split &edge, double turns)
{
  Split found = two_sum(i.value, -j.value);
  found.rest += i.rest - j.rest;
  if (turns != 0.0) {
    const double image = turns * edge.value;
    const Split there = two_sum(found.value, -image);
    found = {there.value,
             found.rest + there.rest - std::fma(turns, edge.value, -image) - turns * edge.rest};
  }
  return found;
}

}  // namespace jamshape
