#pragma once

#include "bindings/arrays.hpp"
#include "landscape/local_energy_model.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

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

/// Rows (k, 2) of the pairs that exist, one or none.
inline nb::object rows_of(const std::array<std::int64_t, 2> &particles)
{
  NewArray<std::int64_t> rows({particles[0] < 0 ? std::size_t{0} : std::size_t{1}, 2});
  if (particles[0] >= 0) std::copy_n(particles.data(), 2, rows.row(0));
  return rows.release();
}

inline nb::object tuple_of(const LandscapeSums &sums)
{
  return nb::make_tuple(sums.energy, array_of(sums.gradient.data(), sums.gradient.size()),
                        sums.strain_gradient, sums.bond_force, sums.n_bonds, rows_of(sums.crossing),
                        rows_of(sums.unconverged),
                        array_of(sums.virial.data(), sums.virial.size()));
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
