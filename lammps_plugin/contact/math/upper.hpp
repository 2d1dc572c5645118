#pragma once

#include "contact/math/vec.hpp"

#include <cmath>

namespace jamshape {

/// An upper triangular matrix, as LAMMPS's cells are: the first cell vector along x, the second in
/// the xy plane. A constant velocity gradient, the resulting deformation and the cell are all of
/// this form. A multiple of the identity acts exactly as a number.
struct Upper {
  Vec<3> diagonal;
  double xy, xz, yz;

  static Upper one() { return {{{1.0, 1.0, 1.0}}, 0.0, 0.0, 0.0}; }

  bool has_shear() const { return xy != 0.0 || xz != 0.0 || yz != 0.0; }
};

/// Upper triangle of a matrix (D, D), given by rows; entries below the diagonal are not read.
template <int D> Upper upper_from(const double *rows)
{
  const auto at = [&](int k, int m) { return k < D && m < D ? rows[D * k + m] : 0.0; };
  return {{{at(0, 0), at(1, 1), at(2, 2)}}, at(0, 1), at(0, 2), at(1, 2)};
}

inline Vec<2> operator*(const Upper &a, const Vec<2> &x)
{
  return {{a.diagonal[0] * x[0] + a.xy * x[1], a.diagonal[1] * x[1]}};
}
inline Vec<3> operator*(const Upper &a, const Vec<3> &x)
{
  return {{a.diagonal[0] * x[0] + a.xy * x[1] + a.xz * x[2], a.diagonal[1] * x[1] + a.yz * x[2],
           a.diagonal[2] * x[2]}};
}

inline Upper operator*(double factor, const Upper &a)
{
  return {factor * a.diagonal, factor * a.xy, factor * a.xz, factor * a.yz};
}
inline Upper operator+(const Upper &a, const Upper &b)
{
  return {a.diagonal + b.diagonal, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
}
inline Upper operator*(const Upper &a, const Upper &b)
{
  const Vec<3> &p = a.diagonal, &q = b.diagonal;
  return {{{p[0] * q[0], p[1] * q[1], p[2] * q[2]}},
          p[0] * b.xy + a.xy * q[1],
          p[0] * b.xz + a.xy * b.yz + a.xz * q[2],
          p[1] * b.yz + a.yz * q[2]};
}

/// `factor` times the inverse of a.
inline Upper divided(double factor, const Upper &a)
{
  const Vec<3> &p = a.diagonal;
  const double xx = 1.0 / p[0], yy = 1.0 / p[1], zz = 1.0 / p[2];
  return {{{factor / p[0], factor / p[1], factor / p[2]}},
          -factor * xx * a.xy * yy,
          factor * xx * (a.xy * yy * a.yz - a.xz) * zz,
          -factor * yy * a.yz * zz};
}

/// exp(a), from its series for a / 2^n, squared n times; the diagonal, which must not lose digits,
/// is computed separately. Exact for a matrix with zero diagonal.
inline Upper exponential(const Upper &a)
{
  const Vec<3> &d = a.diagonal;
  Upper found = Upper::one();
  if (a.has_shear()) {
    int halvings = 0;
    double size = std::fabs(d[0]) + std::fabs(d[1]) + std::fabs(d[2]);
    for (; size > 0.25; size *= 0.5) ++halvings;
    const Upper part = std::ldexp(1.0, -halvings) * a;
    Upper term = Upper::one();
    constexpr int TERMS = 14;  // 0.25^15 / 15! is far below rounding
    for (int k = 1; k <= TERMS; ++k) {
      term = (1.0 / k) * (term * part);
      found = found + term;
    }
    for (int k = 0; k < halvings; ++k) found = found * found;
  }
  for (int k = 0; k < 3; ++k) found.diagonal[k] = std::exp(d[k]);
  return found;
}

}  // namespace jamshape
