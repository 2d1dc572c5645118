#pragma once

#include "contact/math/vec.hpp"

#include <array>
#include <cmath>

namespace jamshape {

struct SymmetricEigen {
  double value;
  Vec<3> vector;
};

/// Largest eigenvalue of a symmetric 3x3 matrix (xx, xy, xz, yy, yz, zz) and its unit eigenvector,
/// by cyclic Jacobi rotations.
inline SymmetricEigen largest_eigenpair(const std::array<double, 6> &m)
{
  double a[3][3] = {{m[0], m[1], m[2]}, {m[1], m[3], m[4]}, {m[2], m[4], m[5]}};
  double v[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  const int sweeps = 12;  // converges quadratically; 6 reach rounding
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (int p = 0; p < 2; ++p) {
      for (int q = p + 1; q < 3; ++q) {
        if (a[p][q] == 0.0) continue;
        const double angle = 0.5 * std::atan2(2.0 * a[p][q], a[q][q] - a[p][p]);
        const double c = std::cos(angle), s = std::sin(angle);
        for (int k = 0; k < 3; ++k) {
          const double x = a[k][p], y = a[k][q];
          a[k][p] = c * x - s * y;
          a[k][q] = s * x + c * y;
        }
        for (int k = 0; k < 3; ++k) {
          const double x = a[p][k], y = a[q][k];
          a[p][k] = c * x - s * y;
          a[q][k] = s * x + c * y;
          const double vx = v[k][p], vy = v[k][q];
          v[k][p] = c * vx - s * vy;
          v[k][q] = s * vx + c * vy;
        }
      }
    }
  }
  int top = 0;
  for (int k = 1; k < 3; ++k) {
    if (a[k][k] > a[top][top]) top = k;
  }
  return {a[top][top], {{v[0][top], v[1][top], v[2][top]}}};
}

}  // namespace jamshape
