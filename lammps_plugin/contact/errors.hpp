#pragma once

#include "contact/contact.hpp"
#include "contact/math/vec.hpp"
#include "contact/power_law.hpp"

#include <algorithm>
#include <limits>

namespace jamshape {

/// Bounds of |value - exact value| of a contact: of its energy, through the error of the overlap;
/// of its force, also through that of the normal; and of its torques, also through that of the
/// points.
struct ContactErrors {
  double energy, force, torque;
};

/// Relative error of the overlap, that of the force due to its direction and magnitude alone, and
/// the distance of the point of contact from the exact one: the input of ContactErrors.
template <class T> struct ErrorsOfGeometry {
  T overlap, normal, point;
};

/// Rounding errors of a shape with closed-form contacts.
template <int D, class Body, class T, int BONDS>
ErrorsOfGeometry<T> errors_of_geometry(const Body &, const Body &,
                                       const Contact<D, T, BONDS> &contact)
{
  constexpr T ROUNDING = 64 * std::numeric_limits<T>::epsilon();
  ErrorsOfGeometry<T> errors{0, ROUNDING, 0};
  for (int b = 0; b < contact.n_bonds; ++b) {
    const Bond<D, T> &bond = contact.bond[b];
    errors.overlap = std::max(errors.overlap, ROUNDING * bond.reach / (bond.reach - bond.distance));
    errors.point = std::max(errors.point, ROUNDING * (bond.reach + norm(bond.arm_i)));
  }
  return errors;
}

/// Errors of a touching contact in its scalar S: its difference from the one in the wider scalar T,
/// plus the error of the latter from the residual and the conditioning of the equations solved. The
/// bodies are those of the contact in full precision T.
template <int D, class Body, class S, class T, int BONDS>
ContactErrors errors_of(const Body &i, const Body &j, const Contact<D, S, BONDS> &contact,
                        const Contact<D, T, BONDS> &wide, const PowerLaw &law)
{
  const ErrorsOfGeometry<T> by = errors_of_geometry(i, j, wide);
  const T of_slope = law.change_of_gradient(by.overlap);
  const T force = norm(wide.force), of_force = of_slope + by.normal + of_slope * by.normal;
  T arm = 0;
  for (int b = 0; b < wide.n_bonds; ++b) {
    const Vec<D, T> arm_j = wide.bond[b].arm_i + (i.centre - j.centre);
    arm = std::max({arm, norm(wide.bond[b].arm_i), norm(arm_j)});
  }
  using Torques = Torque<D, T>;
  const Torques off_i = constants_of<T>(contact.torque_i) - wide.torque_i;
  const Torques off_j = constants_of<T>(contact.torque_j) - wide.torque_j;
  return {static_cast<double>(abs(T(contact.energy) - wide.energy) +
                              wide.energy * law.change_of_energy(by.overlap)),
          static_cast<double>(norm(constants_of<T>(contact.force) - wide.force) + force * of_force),
          static_cast<double>(std::max(norm(off_i), norm(off_j)) +
                              force * (arm * of_force + by.point * (1 + of_force)))};
}

}  // namespace jamshape
