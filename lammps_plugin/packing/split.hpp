#pragma once

#include <cfloat>
#include <cmath>

#ifdef __FAST_MATH__
#error "Double-double arithmetic needs -fno-fast-math."
#endif
static_assert(FLT_EVAL_METHOD == 0,
              "Double-double arithmetic needs doubles without excess precision.");

namespace jamshape {

/// A double-double: a number as the unevaluated sum of a double and its low part.
struct Split {
  double value, rest;
};

/// The sum of two doubles with its exact rounding error (Knuth, The Art of Computer Programming 2,
/// Sec. 4.2.2, Theorem B).
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

/// One coordinate of x_i - x_j, whose leading digits cancel, before rounding, using doubles alone.
inline Split difference(const Split &i, const Split &j)
{
  Split found = two_sum(i.value, -j.value);
  found.rest += i.rest - j.rest;
  return found;
}

/// The same coordinate with j shifted by `turns` lengths.
inline Split difference(const Split &apart, const Split &length, double turns)
{
  const double image = turns * length.value;
  const Split there = two_sum(apart.value, -image);
  return {there.value,
          apart.rest + there.rest - std::fma(turns, length.value, -image) - turns * length.rest};
}

}  // namespace jamshape
