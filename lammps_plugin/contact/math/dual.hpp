#pragma once

#include "contact/math/scalar.hpp"

#include <cmath>

namespace jamshape {

/// Storage of the derivatives of a scalar: doubles in pairs, as every processor computes with;
/// compilers find few such pairs by themselves.
template <class S> struct RegisterOf {
  using Type = S;
  static constexpr int LANES = 1;
};
template <> struct RegisterOf<double> {
  using Type = double __attribute__((vector_size(16)));
  static constexpr int LANES = 2;
};

/// A number with its derivatives with respect to N variables: forward-mode differentiation,
/// accurate to rounding. Force code written for any scalar gives its exact derivative when run on
/// these numbers, so that no second derivative is coded by hand. Branches depend on the values
/// alone.
template <int N, class S = double> struct Dual {
  S value;

  Dual() = default;
  Dual(S x) : value(x), d{} {}  // constants convert implicitly

  /// The k-th variable, with value x.
  static Dual variable(S x, int k)
  {
    Dual a(x);
    a.set_derivative(k, 1);
    return a;
  }

  /// The derivative with respect to the k-th variable.
  S derivative(int k) const
  {
    if constexpr (LANES == 1)
      return d[k];
    else
      return d[k / LANES][k % LANES];
  }
  void set_derivative(int k, S x)
  {
    if constexpr (LANES == 1)
      d[k] = x;
    else
      d[k / LANES][k % LANES] = x;
  }

  /// The function value f(x), with derivatives f'(x) times those of x.
  [[gnu::always_inline]] Dual chain(S f, S slope) const
  {
    Dual a(f);
    for (int k = 0; k < REGISTERS; ++k) a.d[k] = slope * d[k];
    return a;
  }

  [[gnu::always_inline]] Dual &operator+=(const Dual &b)
  {
    value += b.value;
    for (int k = 0; k < REGISTERS; ++k) d[k] += b.d[k];
    return *this;
  }
  [[gnu::always_inline]] Dual &operator-=(const Dual &b)
  {
    value -= b.value;
    for (int k = 0; k < REGISTERS; ++k) d[k] -= b.d[k];
    return *this;
  }
  [[gnu::always_inline]] Dual &operator*=(const Dual &b)
  {
    for (int k = 0; k < REGISTERS; ++k) d[k] = d[k] * b.value + value * b.d[k];
    value *= b.value;
    return *this;
  }
  [[gnu::always_inline]] Dual &operator/=(const Dual &b)
  {
    return *this *= b.chain(1 / b.value, -1 / (b.value * b.value));
  }

  [[gnu::always_inline]] friend Dual operator+(Dual a, const Dual &b) { return a += b; }
  [[gnu::always_inline]] friend Dual operator-(Dual a, const Dual &b) { return a -= b; }
  [[gnu::always_inline]] friend Dual operator*(Dual a, const Dual &b) { return a *= b; }
  [[gnu::always_inline]] friend Dual operator/(Dual a, const Dual &b) { return a /= b; }
  [[gnu::always_inline]] friend Dual operator-(const Dual &a) { return a.chain(-a.value, -1); }

  [[gnu::always_inline]] friend bool operator<(const Dual &a, const Dual &b)
  {
    return a.value < b.value;
  }
  [[gnu::always_inline]] friend bool operator>(const Dual &a, const Dual &b)
  {
    return a.value > b.value;
  }
  [[gnu::always_inline]] friend bool operator<=(const Dual &a, const Dual &b)
  {
    return a.value <= b.value;
  }
  [[gnu::always_inline]] friend bool operator==(const Dual &a, const Dual &b)
  {
    return a.value == b.value;
  }
  [[gnu::always_inline]] friend bool operator!=(const Dual &a, const Dual &b)
  {
    return a.value != b.value;
  }

  [[gnu::always_inline]] friend Dual sqrt(const Dual &a)
  {
    const S root = std::sqrt(a.value);
    return a.chain(root, 1 / (2 * root));
  }
  [[gnu::always_inline]] friend Dual log(const Dual &a)
  {
    return a.chain(std::log(a.value), 1 / a.value);
  }
  [[gnu::always_inline]] friend Dual log1p(const Dual &a)
  {
    return a.chain(std::log1p(a.value), 1 / (1 + a.value));
  }
  [[gnu::always_inline]] friend Dual exp(const Dual &a)
  {
    const S power = std::exp(a.value);
    return a.chain(power, power);
  }
  /// Power of a non-negative base to a constant exponent that is at least 1.
  [[gnu::always_inline]] friend Dual pow(const Dual &a, const S &exponent)
  {
    return a.chain(std::pow(a.value, exponent), exponent * std::pow(a.value, exponent - 1));
  }
  [[gnu::always_inline]] friend Dual abs(const Dual &a) { return a.value < 0 ? -a : a; }
  [[gnu::always_inline]] friend Dual copysign(const Dual &a, const Dual &b)
  {
    return std::signbit(a.value) == std::signbit(b.value) ? a : -a;
  }

 private:
  static constexpr int LANES = RegisterOf<S>::LANES, REGISTERS = (N + LANES - 1) / LANES;
  typename RegisterOf<S>::Type d[REGISTERS];
};

template <int N, class S> S value_of(const Dual<N, S> &x) { return x.value; }
template <int N, class S> Dual<N, S> constant(const Dual<N, S> &x) { return x.value; }
template <int N, class S> Dual<N, S> with_value(Dual<N, S> x, const S &value)
{
  x.value = value;
  return x;
}

}  // namespace jamshape
