#pragma once

#include <cmath>

namespace jamshape {

/// The functions that contact geometry takes of a scalar, under names that dual numbers share.
using std::abs;
using std::copysign;
using std::log;
using std::sqrt;

/// The plain number in a scalar: of a dual number its value.
inline double value_of(double x) { return x; }
inline long double value_of(long double x) { return x; }

/// A scalar as a constant: of a dual number what it is without its derivatives.
inline double constant(double x) { return x; }
inline long double constant(long double x) { return x; }

}  // namespace jamshape
