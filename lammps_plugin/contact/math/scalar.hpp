#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

namespace jamshape {

/// The functions that contact geometry takes of a scalar, under names that dual numbers share.
using std::abs;
using std::copysign;
using std::exp;
using std::floor;
using std::isfinite;
using std::log;
using std::log1p;
using std::pow;
using std::round;
using std::sqrt;

/// The plain number in a scalar: of a dual number its value.
inline double value_of(double x) { return x; }
inline long double value_of(long double x) { return x; }

/// The type of the plain number in a scalar S; only to be named where value_of(S) is declared.
template <class S> using ValueOf = std::decay_t<decltype(value_of(std::declval<S>()))>;

/// What lengths of a shape are that nothing is differentiated by: doubles, in packs one a lane.
template <class S> struct PlainOf {
  using Type = double;
};
template <class S> using Plain = typename PlainOf<S>::Type;

/// The type of a number that counts for all of a scalar: for all lanes of a pack one double.
template <class T> struct CommonOf {
  using Type = T;
};
template <class T> using Common = typename CommonOf<T>::Type;

/// What a comparison of scalars gives.
template <class S> using Truth = decltype(std::declval<S>() < std::declval<S>());

/// `a` where a condition holds, else `b`; the smaller and the larger of two: under names that packs
/// share, of which every lane chooses for itself.
template <class S> S select(bool where, const S &a, const S &b) { return where ? a : b; }
template <class S> S least(const S &a, const S &b) { return std::min(a, b); }
template <class S> S most(const S &a, const S &b) { return std::max(a, b); }
/// Exchanges two where a condition holds.
template <class S> void exchange(const bool &where, S &a, S &b)
{
  if (where) std::swap(a, b);
}
inline bool any(bool truth) { return truth; }
inline bool all(bool truth) { return truth; }

/// A scalar as a constant: of a dual number what it is without its derivatives.
inline double constant(double x) { return x; }
inline long double constant(long double x) { return x; }

/// A scalar moved to another value within its rounding: a dual number keeps its derivatives.
inline double with_value(double, double value) { return value; }
inline long double with_value(long double, long double value) { return value; }

}  // namespace jamshape
