#pragma once

namespace jamshape {
namespace {  // compiled for several instruction sets: not to be merged by the linker

/// Factorises a square of n columns, its elements (r, c), r >= c, at l[stride * c + r], into
/// l d l^T, with d on the diagonal. Returns false if a pivot is not positive.
inline bool factorise_square(double *square, int stride, int n, double *inverse_pivots)
{
  const auto l = [&](int r, int c) -> double & { return square[stride * c + r]; };
  for (int k = 0; k < n; ++k) {
    if (!(l(k, k) > 0.0)) return false;
    inverse_pivots[k] = 1.0 / l(k, k);
    for (int c = k + 1; c < n; ++c) {
      for (int r = c; r < n; ++r) l(r, c) -= l(r, k) * inverse_pivots[k] * l(c, k);
    }
    for (int r = k + 1; r < n; ++r) l(r, k) *= inverse_pivots[k];
  }
  return true;
}

}  // namespace
}  // namespace jamshape
