#pragma once

#include "contact/contact.hpp"
#include "contact/math/vec.hpp"

#include <algorithm>
#include <limits>

namespace jamshape {

/// Bounds of |value - exact value| of a contact: of its energy, which errs with its overlap; of its
/// force, which errs with its normal as well; and of its torques, which err with its points, too.
struct ContactErrors {
  double energy, force, torque;
};

/// The relative error of the overlap, that of the force by its direction and length alone, and how
/// far off the point of contact is: what ContactErrors follow from.
template <class T> struct ErrorsOfGeometry {
  T overlap, normal, point;
};

/// Of a shape in closed form: rounding.
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

/// Errors of a contact that touches, whatever its scalar S: how far it is from the one in the wider
/// scalar T, and what that one may be off itself by the residual and the conditioning of the
/// equations that it solves. The bodies are those of the contact to all digits of T.
template <int D, class Body, class S, class T, int BONDS>
ContactErrors errors_of(const Body &i, const Body &j, const Contact<D, S, BONDS> &contact,
                        const Contact<D, T, BONDS> &wide)
{
  const ErrorsOfGeometry<T> by = errors_of_geometry(i, j, wide);
  const T force = norm(wide.force), of_force = by.overlap + by.normal + by.overlap * by.normal;
  T arm = 0;
  for (int b = 0; b < wide.n_bonds; ++b) {
    const Vec<D, T> arm_j = wide.bond[b].arm_i + (i.centre - j.centre);
    arm = std::max({arm, norm(wide.bond[b].arm_i), norm(arm_j)});
  }
  using Torques = Torque<D, T>;
  const Torques off_i = constants_of<T>(contact.torque_i) - wide.torque_i;
  const Torques off_j = constants_of<T>(contact.torque_j) - wide.torque_j;
  return {static_cast<double>(abs(T(contact.energy) - wide.energy) +
                              wide.energy * by.overlap * (2 + by.overlap)),
          static_cast<double>(norm(constants_of<T>(contact.force) - wide.force) + force * of_force),
          static_cast<double>(std::max(norm(off_i), norm(off_j)) +
                              force * (arm * of_force + by.point * (1 + of_force)))};
}

}  // namespace jamshape
