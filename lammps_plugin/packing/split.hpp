#pragma once

#include <cfloat>
#include <cmath>
#include <cstdint>
#include <cstring>

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

/// The same number as split(joined(x)), a double-double rounded to a long double, in doubles alone:
/// several at once take a fraction of the time.
inline Split rounded_to_long(const Split &x)
{
#if LDBL_MANT_DIG == 64
  const Split sum = two_sum(x.value, x.rest);
  std::uint64_t bits;
  std::memcpy(&bits, &sum.value, sizeof bits);
  bits &= 0x7ff0000000000000;
  double power;  // of two, not above |value|
  std::memcpy(&power, &bits, sizeof power);
  // The spacing of doubles near this is that of long doubles near the number.
  const double coarse = 0x1.8p-11 * power;
  return two_sum(sum.value, (sum.rest + coarse) - coarse);
#else
  return split(joined(x));
#endif
}

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
