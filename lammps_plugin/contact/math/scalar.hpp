#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

namespace jamshape {

/// Functions that contact geometry uses, under names that dual numbers share.
using std::abs;
using std::copysign;
using std::exp;
using std::expm1;
using std::floor;
using std::isfinite;
using std::log;
using std::log1p;
using std::pow;
using std::round;
using std::sqrt;

/// The plain number in a scalar: the value of a dual number.
inline double value_of(double x) { return x; }
inline long double value_of(long double x) { return x; }

/// The type of the plain number in a scalar S; usable only where value_of(S) is declared.
template <class S> using ValueOf = std::decay_t<decltype(value_of(std::declval<S>()))>;

/// The type of a shape's lengths, which nothing is differentiated by: doubles; in packs, one per
/// lane.
template <class S> struct PlainOf {
  using Type = double;
};
template <class S> using Plain = typename PlainOf<S>::Type;

/// The type of a number common to all lanes of a scalar: one double for a pack.
template <class T> struct CommonOf {
  using Type = T;
};
template <class T> using Common = typename CommonOf<T>::Type;

/// The result type of a comparison of scalars.
template <class S> using Truth = decltype(std::declval<S>() < std::declval<S>());

/// `a` where a condition holds, else `b`; the smaller and the larger of two numbers. Packs share
/// these names and choose lane by lane.
template <class S> S select(bool where, const S &a, const S &b) { return where ? a : b; }
template <class S> S least(const S &a, const S &b) { return std::min(a, b); }
template <class S> S most(const S &a, const S &b) { return std::max(a, b); }
/// Exchanges two scalars where a condition holds.
template <class S> void exchange(const bool &where, S &a, S &b)
{
  if (where) std::swap(a, b);
}
inline bool any(bool truth) { return truth; }
inline bool all(bool truth) { return truth; }

/// A scalar as a constant: a dual number loses its derivatives.
inline double constant(double x) { return x; }
inline long double constant(long double x) { return x; }

/// A scalar moved to another value within rounding: a dual number keeps its derivatives.
inline double with_value(double, double value) { return value; }
inline long double with_value(long double, long double value) { return value; }

}  // namespace jamshape
