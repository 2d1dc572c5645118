#pragma once

#include <vector>

namespace jamshape {

/// Coefficients of the second-order Runge-Kutta-Chebyshev method with s stages: Sommeijer, Shampine
/// & Verwer, J. Comput. Appl. Math. 88, 315 (1998), recurrences of Eqs. 2.3-2.8, written for
/// displacements from the start of the step, so that nothing cancels in large coordinates.
struct RungeKuttaChebyshev {
  /// d_j = h of_start F_0 + h of_last_rate F_{j-1} + of_last d_{j-1} + of_one_before d_{j-2}
  struct Stage {
    double c;  // position in the step, 0 to 1
    double of_start, of_last_rate, of_last, of_one_before;
  };
  int s;
  std::vector<Stage> stage;  // from 1 to s

  explicit RungeKuttaChebyshev(int s);

  /// Stable if the step times the largest rate is below this.
  static double interval(int s);
  /// The smallest number of stages whose interval reaches z, but at most `most`.
  static int stages(double z, int most);
};

}  // namespace jamshape
