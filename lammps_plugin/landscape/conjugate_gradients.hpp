#pragma once

#include <Eigen/Core>

namespace jamshape {

/// End of conjugate gradients: with a solution, along a direction of negative curvature, or
/// after the allowed number of iterations.
enum class Solved { YES, FALLS, TOO_LONG };

struct Iterated {
  Eigen::VectorXd x, last;  // x and the last direction
  Solved end;
  Eigen::Index n;  // products with the matrix
};

/// Solves matrix x = right by preconditioned conjugate gradients (Nocedal & Wright, Numerical
/// Optimization, Alg. 5.3 and 7.1), which in exact arithmetic end after as many iterations as there
/// are coordinates. `times(vector)` is the product with the matrix, `near(vector)` an approximate
/// solution, and `is_done(rest, part)` is asked about the remainder and its squared norm in the
/// metric of approximate solutions, over that of the right-hand side.
template <class Times, class Near, class IsDone>
Iterated conjugate_gradients(const Eigen::Ref<const Eigen::VectorXd> &right, Eigen::Index most,
                             const Times &times, const Near &near, const IsDone &is_done)
{
  Eigen::VectorXd rest = right, preconditioned = near(rest);
  Iterated found{Eigen::VectorXd::Zero(right.size()), preconditioned, Solved::YES, 0};
  double product = rest.dot(preconditioned);
  const double first = product;
  while (!is_done(rest, product / first) && found.n < right.size()) {
    if (found.n == most) {
      found.end = Solved::TOO_LONG;
      break;
    }
    const Eigen::VectorXd pulled = times(found.last);
    const double curvature = found.last.dot(pulled);
    ++found.n;
    if (!(curvature > 0.0)) {
      if (found.n == 1) found.x = found.last;
      found.end = Solved::FALLS;
      break;
    }
    const double length = product / curvature;
    found.x += length * found.last;
    rest -= length * pulled;
    preconditioned = near(rest);
    const double next = rest.dot(preconditioned);
    found.last = preconditioned + (next / product) * found.last;
    product = next;
  }
  return found;
}

}  // namespace jamshape
