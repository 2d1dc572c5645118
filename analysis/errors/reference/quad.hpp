#pragma once

// __float128, 113 bits (33 digits), as a scalar of the templates of contact/.

#include <cmath>
#include <limits>
#include <quadmath.h>

namespace jamshape {

struct Quad {
  __float128 v;
  Quad() = default;
  template <class A> constexpr Quad(A x) : v(x) {}
  explicit operator double() const { return static_cast<double>(v); }
  explicit operator long double() const { return static_cast<long double>(v); }
  explicit operator int() const { return static_cast<int>(v); }

  friend constexpr Quad operator+(Quad a, Quad b) { return a.v + b.v; }
  friend constexpr Quad operator-(Quad a, Quad b) { return a.v - b.v; }
  friend constexpr Quad operator*(Quad a, Quad b) { return a.v * b.v; }
  friend constexpr Quad operator/(Quad a, Quad b) { return a.v / b.v; }
  friend Quad operator-(Quad a) { return -a.v; }
  friend Quad &operator+=(Quad &a, Quad b) { return a = a + b; }
  friend Quad &operator-=(Quad &a, Quad b) { return a = a - b; }
  friend Quad &operator*=(Quad &a, Quad b) { return a = a * b; }
  friend Quad &operator/=(Quad &a, Quad b) { return a = a / b; }
  friend bool operator<(Quad a, Quad b) { return a.v < b.v; }
  friend bool operator>(Quad a, Quad b) { return a.v > b.v; }
  friend bool operator<=(Quad a, Quad b) { return a.v <= b.v; }
  friend bool operator>=(Quad a, Quad b) { return a.v >= b.v; }
  friend bool operator==(Quad a, Quad b) { return a.v == b.v; }
  friend bool operator!=(Quad a, Quad b) { return a.v != b.v; }

  friend Quad sqrt(Quad a) { return sqrtq(a.v); }
  friend Quad pow(Quad a, Quad b) { return powq(a.v, b.v); }
  friend Quad log1p(Quad a) { return log1pq(a.v); }
  friend Quad expm1(Quad a) { return expm1q(a.v); }
  friend Quad abs(Quad a) { return fabsq(a.v); }
  friend Quad copysign(Quad a, Quad b) { return copysignq(a.v, b.v); }
  friend Quad floor(Quad a) { return floorq(a.v); }
  friend Quad round(Quad a) { return roundq(a.v); }
  friend Quad cos(Quad a) { return cosq(a.v); }
  friend Quad sin(Quad a) { return sinq(a.v); }
  friend bool isfinite(Quad a) { return finiteq(a.v) != 0; }
};

inline Quad value_of(Quad x) { return x; }
inline Quad constant(Quad x) { return x; }
inline Quad with_value(Quad, Quad value) { return value; }

}  // namespace jamshape

template <> struct std::numeric_limits<jamshape::Quad> {
  static constexpr int digits = 113;
  static constexpr jamshape::Quad epsilon() { return FLT128_EPSILON; }
  static constexpr jamshape::Quad max() { return FLT128_MAX; }
  static constexpr jamshape::Quad infinity() { return __builtin_inff128(); }
};
