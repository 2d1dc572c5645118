#pragma once

#include <cmath>

namespace jamshape {

/// Vector of D components; an aggregate, so that `Vec<2>{x, y}` is all there is to construct.
template <int D> struct Vec {
  double c[D];
  double &operator[](int k) { return c[k]; }
  double operator[](int k) const { return c[k]; }
};

/// Rotations have one component in 2D (about z) and three in 3D.
template <int D> inline constexpr int ROTATIONS = D == 2 ? 1 : 3;
template <int D> using Torque = Vec<ROTATIONS<D>>;

template <int D> Vec<D> &operator+=(Vec<D> &a, const Vec<D> &b)
{
  for (int k = 0; k < D; ++k) a[k] += b[k];
  return a;
}

template <int D> Vec<D> &operator-=(Vec<D> &a, const Vec<D> &b)
{
  for (int k = 0; k < D; ++k) a[k] -= b[k];
  return a;
}

template <int D> Vec<D> operator+(Vec<D> a, const Vec<D> &b) { return a += b; }
template <int D> Vec<D> operator-(Vec<D> a, const Vec<D> &b) { return a -= b; }

template <int D> Vec<D> operator*(double s, Vec<D> a)
{
  for (int k = 0; k < D; ++k) a[k] *= s;
  return a;
}

template <int D> Vec<D> operator-(const Vec<D> &a) { return -1.0 * a; }

template <int D> double dot(const Vec<D> &a, const Vec<D> &b)
{
  double sum = a[0] * b[0];
  for (int k = 1; k < D; ++k) sum += a[k] * b[k];
  return sum;
}

template <int D> double norm_sq(const Vec<D> &a) { return dot(a, a); }
template <int D> double norm(const Vec<D> &a) { return std::sqrt(norm_sq(a)); }

inline Vec<1> cross(const Vec<2> &a, const Vec<2> &b) { return {{a[0] * b[1] - a[1] * b[0]}}; }

inline Vec<3> cross(const Vec<3> &a, const Vec<3> &b)
{
  return {{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}};
}

}  // namespace jamshape
