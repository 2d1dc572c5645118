#pragma once

#include "contact/math/scalar.hpp"

namespace jamshape {

/// Vector of D components of a scalar type S; an aggregate, constructed as `Vec<2>{x, y}`. S is
/// double in the hot loops, long double where doubles are not precise enough, and a dual number for
/// derivatives.
template <int D, class S = double> struct Vec {
  S c[D];
  S &operator[](int k) { return c[k]; }
  const S &operator[](int k) const { return c[k]; }
};

/// Rotations have one component in 2D (about z) and three in 3D.
template <int D> inline constexpr int ROTATIONS = D == 2 ? 1 : 3;
template <int D, class S = double> using Torque = Vec<ROTATIONS<D>, S>;

template <int D, class S>
[[gnu::always_inline]] inline Vec<D, S> &operator+=(Vec<D, S> &a, const Vec<D, S> &b)
{
  for (int k = 0; k < D; ++k) a[k] += b[k];
  return a;
}

template <int D, class S>
[[gnu::always_inline]] inline Vec<D, S> &operator-=(Vec<D, S> &a, const Vec<D, S> &b)
{
  for (int k = 0; k < D; ++k) a[k] -= b[k];
  return a;
}

template <int D, class S>
[[gnu::always_inline]] inline Vec<D, S> operator+(Vec<D, S> a, const Vec<D, S> &b)
{
  return a += b;
}
template <int D, class S>
[[gnu::always_inline]] inline Vec<D, S> operator-(Vec<D, S> a, const Vec<D, S> &b)
{
  return a -= b;
}

/// Keeps a parameter out of template argument deduction: `2.0 * v` for a vector of any scalar.
template <class S> struct Itself {
  using Type = S;
};

template <int D, class S>
[[gnu::always_inline]] inline Vec<D, S> operator*(const typename Itself<S>::Type &s, Vec<D, S> a)
{
  for (int k = 0; k < D; ++k) a[k] *= s;
  return a;
}

template <int D, class S> [[gnu::always_inline]] inline Vec<D, S> operator-(const Vec<D, S> &a)
{
  return -1.0 * a;
}

template <int D, class S>
[[gnu::always_inline]] inline S dot(const Vec<D, S> &a, const Vec<D, S> &b)
{
  S sum = a[0] * b[0];
  for (int k = 1; k < D; ++k) sum += a[k] * b[k];
  return sum;
}

template <int D, class S> [[gnu::always_inline]] inline S norm_sq(const Vec<D, S> &a)
{
  return dot(a, a);
}

template <int D, class S> [[gnu::always_inline]] inline S norm(const Vec<D, S> &a)
{
  return sqrt(norm_sq(a));
}

template <class S> [[gnu::always_inline]] inline S norm(const Vec<1, S> &a) { return abs(a[0]); }

/// Component by component.
template <int D, class S>
[[gnu::always_inline]] inline Vec<D, ValueOf<S>> values_of(const Vec<D, S> &a)
{
  Vec<D, ValueOf<S>> values;
  for (int k = 0; k < D; ++k) values[k] = value_of(a[k]);
  return values;
}

/// The same vector in another scalar type, as constants.
template <class S, int D, class V>
[[gnu::always_inline]] inline Vec<D, S> constants_of(const Vec<D, V> &values)
{
  Vec<D, S> constants;
  for (int k = 0; k < D; ++k) constants[k] = S(values[k]);
  return constants;
}

/// `a` where a condition holds, else `b`.
template <int D, class S>
[[gnu::always_inline]] inline Vec<D, S> chosen(const Truth<S> &where, const Vec<D, S> &a,
                                               const Vec<D, S> &b)
{
  Vec<D, S> c;
  for (int k = 0; k < D; ++k) c[k] = select(where, a[k], b[k]);
  return c;
}

template <class S>
[[gnu::always_inline]] inline Vec<1, S> cross(const Vec<2, S> &a, const Vec<2, S> &b)
{
  return {{a[0] * b[1] - a[1] * b[0]}};
}

template <class S>
[[gnu::always_inline]] inline Vec<3, S> cross(const Vec<3, S> &a, const Vec<3, S> &b)
{
  return {{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}};
}

}  // namespace jamshape
