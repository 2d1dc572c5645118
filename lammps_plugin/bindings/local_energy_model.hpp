#pragma once

#include "bindings/arrays.hpp"
#include "landscape/local_energy_model.hpp"

#include <algorithm>

namespace jamshape {

inline nb::object array_of(const double *from, std::size_t n)
{
  NewArray<double> to({n});
  std::copy_n(from, n, to.row(0));
  return to.release();
}

inline Eigen::Map<const Eigen::VectorXd> vector(const Array1<double> &of)
{
  return {of.data(), static_cast<Eigen::Index>(of.shape(0))};
}

inline nb::object tuple_of(const LandscapeSums &sums)
{
  return nb::make_tuple(sums.energy, array_of(sums.gradient.data(), sums.gradient.size()),
                        sums.strain_gradient, sums.bond_force, sums.n_bonds, sums.crossing,
                        sums.unconverged, array_of(sums.virial.data(), sums.virial.size()));
}

/// Callback that gives a local energy model new pairs: a Python function of x and the strain.
inline auto renewing(const LocalEnergyModel &of, const nb::callable &renew)
{
  return [&of, renew](const Displacement &at) { renew(array_of(at.x, of.n()), at.strain); };
}

inline void require_base(const LocalEnergyModel &of)
{
  require(of.has_base(), "there is no base yet, expected move_to before.");
}

/// Solutions for the rows of right (k, n).
template <class Solve> nb::object solutions(const Array2<double> &right, const Solve &solve)
{
  const std::size_t n = right.shape(1);
  NewArray<double> solution({right.shape(0), n});
  for (std::size_t k = 0; k < right.shape(0); ++k) {
    const Eigen::Map<const Eigen::VectorXd> side(right.data() + k * n, n);
    Eigen::Map<Eigen::VectorXd>(solution.row(k), n) = solve(side);
  }
  return solution.release();
}

}  // namespace jamshape
