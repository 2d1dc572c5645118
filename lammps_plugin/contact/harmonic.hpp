#pragma once

namespace jamshape {

/// One-sided harmonic law of the overlap x = 1 - r/d: V = k_e/2 x^2 for x > 0 (Marschall & Teitel
/// 2018, Eq. 22). Overlaps are dimensionless; k_e is an energy.
template <class K> struct HarmonicOf {
  K k_e;

  template <class S> S energy(const S &overlap) const { return 0.5 * k_e * overlap * overlap; }
  template <class S> S energy_gradient(const S &overlap) const { return k_e * overlap; }
  template <class S> S energy_hessian(const S &) const { return k_e; }
};
using Harmonic = HarmonicOf<double>;

}  // namespace jamshape
