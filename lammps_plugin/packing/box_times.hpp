#pragma once

#include <cmath>

namespace jamshape {

/// Viscosity k_d d^2 of the host, d the diameter of a disc or sphere of the mean measure of the
/// particles. Packings relax at a pressure p in about k_d d^2 / p.
inline double host_viscosity(double drag, double measure, int dimension)
{
  const double d =
      dimension == 2 ? std::sqrt(4.0 * measure / M_PI) : std::cbrt(6.0 * measure / M_PI);
  return drag * d * d;
}

/// Default of the time in which a box yields, k_d d^2 A / k_e, A the mean measure: the resistance
/// to its motion, t_box k_e N / V, is then the viscosity of the host at a packing fraction of 1, so
/// that it takes as long as packings do, at any pressure. In single precision, so that it does not
/// depend on the order of particles.
inline double default_box_time(double viscosity, double measure, double stiffness)
{
  return static_cast<float>(viscosity * measure / stiffness);
}

}  // namespace jamshape
