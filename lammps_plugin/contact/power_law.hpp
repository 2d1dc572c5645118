#pragma once

#include "contact/math/scalar.hpp"

namespace jamshape {

/// Smallest power of a contact law, that of harmonic contacts: below it, stiffness diverges where
/// contacts open.
inline constexpr double HARMONIC = 2.0;

/// x^power, kept out of the code of harmonic contacts, which packs would otherwise inline it into.
template <class S> [[gnu::noinline, gnu::cold]] S raised(const S &x, double power)
{
  return pow(x, power);
}

/// One-sided law of the overlap x = 1 - r/d: V = k_e/A x^A for x > 0, with the power A >= 2 (O'Hern
/// et al. 2003, Eq. 1): 2 is harmonic (Marschall & Teitel 2018, Eq. 22), 5/2 Hertz's law. Overlaps
/// are dimensionless; k_e is an energy.
template <class K> struct PowerLawOf {
  K k_e;
  double power = HARMONIC;

  bool is_harmonic() const { return power == HARMONIC; }

  template <class S> S energy(const S &overlap) const
  {
    if (is_harmonic()) return 0.5 * k_e * overlap * overlap;
    return (k_e / power) * raised(overlap, power);
  }
  template <class S> S energy_gradient(const S &overlap) const
  {
    if (is_harmonic()) return k_e * overlap;
    return k_e * raised(overlap, power - 1.0);
  }
  /// Constant in dual numbers: its derivative is never needed.
  template <class S> S energy_hessian(const S &overlap) const
  {
    if (is_harmonic()) return k_e;
    return ((power - 1.0) * k_e) * raised(value_of(overlap), power - HARMONIC);
  }

  /// E'^2 / (2 E E''), 1 for the harmonic law.
  double steepness() const { return power / (2.0 * (power - 1.0)); }

  /// Relative change of energy and gradient where the overlap grows by a relative change.
  template <class S> S change_of_energy(const S &change) const
  {
    return is_harmonic() ? change * (2 + change) : expm1(power * log1p(change));
  }
  template <class S> S change_of_gradient(const S &change) const
  {
    return is_harmonic() ? change : expm1((power - 1.0) * log1p(change));
  }
};
using PowerLaw = PowerLawOf<double>;

}  // namespace jamshape
