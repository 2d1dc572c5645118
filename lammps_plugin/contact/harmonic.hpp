#pragma once

namespace jamshape {

/// One-sided harmonic law of the overlap x = 1 - r/d: V = k_e/2 x^2 for x > 0
/// (Marschall & Teitel 2018, Eq. 22). Overlaps are without unit; k_e is an energy.
struct Harmonic {
  double k_e;

  double energy(double overlap) const { return 0.5 * k_e * overlap * overlap; }
  double energy_gradient(double overlap) const { return k_e * overlap; }
  double energy_hessian(double) const { return k_e; }
};

}  // namespace jamshape
