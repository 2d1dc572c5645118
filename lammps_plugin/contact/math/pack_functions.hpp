#pragma once

#include "contact/math/pack.hpp"

#include <limits>

/// Elementary functions for all lanes of a pack at once, accurate to about two roundings. They are
/// sums and products in a fixed order, so that they round identically with every instruction set.
namespace jamshape {
inline namespace JAMSHAPE_SET {

// ln 2 = LN2 + LN2_REST; the product of LN2 and an integer up to 2^20 is exact.
inline constexpr double LN2 = 0x1.62e42fep-1, LN2_REST = 0x1.f473de6af278fp-30;
inline constexpr double PER_LN2 = 0x1.71547652b82fep+0;

/// c[0] + c[1] x + ... + c[N - 1] x^(N - 1), even and odd powers apart, as two chains of operations
/// at the same time.
template <int N> Pack polynomial(const double (&c)[N], const Pack &x)
{
  const Pack square = x * x;
  Pack sum[2] = {c[N - 2], c[N - 1]};
  for (int k = N - 3; k >= 0; k -= 2) {
    sum[1] = sum[1] * square + c[k];
    if (k > 0) sum[0] = sum[0] * square + c[k - 1];
  }
  return N % 2 == 0 ? sum[0] + x * sum[1] : sum[1] + x * sum[0];
}

/// exp(k ln 2 + r), |r| < ln 2 / 2, by the Taylor series of exp(r). Returns 0 below the smallest
/// normal number.
inline Pack exp(const Pack &x)
{
  constexpr double SERIES[] = {1.0,
                               1.0,
                               1.0 / 2,
                               1.0 / 6,
                               1.0 / 24,
                               1.0 / 120,
                               1.0 / 720,
                               1.0 / 5040,
                               1.0 / 40320,
                               1.0 / 362880,
                               1.0 / 3628800,
                               1.0 / 39916800,
                               1.0 / 479001600,
                               1.0 / 6227020800};
  constexpr double LEAST = -708.0, MOST = 709.0;
  const Pack within = least(most(x, LEAST), MOST), k = nearest_whole(within * PER_LN2);
  const Pack r = (within - k * LN2) - k * LN2_REST;
  const Pack found = polynomial(SERIES, r) * power_of_two(k);
  return select(x < LEAST, 0.0, select(x > MOST, std::numeric_limits<double>::infinity(), found));
}

/// ln x = k ln 2 + 2 artanh((m - 1) / (m + 1)), x = 2^k m, m from sqrt(1/2) to sqrt(2). Returns NaN
/// unless x is a positive normal number.
inline Pack log(const Pack &x)
{
  constexpr double SERIES[] = {2.0 / 3,  2.0 / 5,  2.0 / 7,  2.0 / 9,  2.0 / 11,
                               2.0 / 13, 2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21};
  const PowerOfTwo part(x);
  const Pack s = (part.rest - 1.0) / (part.rest + 1.0), z = s * s;
  const Pack of_rest = 2.0 * s + (s * z * polynomial(SERIES, z) + part.power * LN2_REST);
  const Mask normal =
      (x >= std::numeric_limits<double>::min()) & (x <= std::numeric_limits<double>::max());
  return select(normal, part.power * LN2 + of_rest, std::numeric_limits<double>::quiet_NaN());
}

/// ln(1 + x) from the logarithm of the rounded sum, corrected for the rounding.
inline Pack log1p(const Pack &x)
{
  const Pack sum = 1.0 + x;
  return log(sum) + (x - (sum - 1.0)) / sum;
}

/// Power of a non-negative base to a positive exponent. The relative error grows as power * ln x.
inline Pack pow(const Pack &x, double power)
{
  return select(x < Pack(std::numeric_limits<double>::min()), 0.0, exp(power * log(x)));
}

}  // namespace JAMSHAPE_SET
}  // namespace jamshape
