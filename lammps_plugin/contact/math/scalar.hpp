#pragma once

#include <cmath>
#include <utility>

namespace jamshape {

/// The functions that contact geometry takes of a scalar, under names that dual numbers share.
using std::abs;
using std::copysign;
using std::exp;
using std::log;
using std::log1p;
using std::pow;
using std::sqrt;

/// The plain number in a scalar: of a dual number its value.
inline double value_of(double x) { return x; }
inline long double value_of(long double x) { return x; }

/// The type of the plain number in a scalar S; only to be named where value_of(S) is declared.
template <class S> using ValueOf = decltype(value_of(std::declval<S>()));

/// A scalar as a constant: of a dual number what it is without its derivatives.
inline double constant(double x) { return x; }
inline long double constant(long double x) { return x; }

/// A scalar moved to another value within its rounding: a dual number keeps its derivatives.
inline double with_value(double, double value) { return value; }
inline long double with_value(long double, long double value) { return value; }

}  // namespace jamshape
