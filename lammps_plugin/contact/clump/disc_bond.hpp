#pragma once

#include "contact/contact.hpp"
#include "contact/math/vec.hpp"
#include "contact/power_law.hpp"

namespace jamshape {

/// Two discs (balls in 3D) of two bodies: arms from the centres of the bodies to theirs, the vector
/// between their centres, into i, and their radii.
template <int D, class S> struct TwoDiscs {
  Vec<D, S> arm_i, arm_j, apart;
  double radius_i, radius_j;
};

/// Adds the bond of two discs to the contact of their bodies if they touch: of the energy of
/// the overlap 1 - r/d, along the line of centres. Coinciding centres, and more bonds than a
/// contact holds, leave it without any.
template <int D, class S, int BONDS>
void add_disc_bond(Contact<D, S, BONDS> &contact, const TwoDiscs<D, S> &discs, const PowerLaw &law)
{
  if (contact.status == ContactStatus::CROSSING) return;
  const double reach = discs.radius_i + discs.radius_j;
  const ValueOf<S> square = norm_sq(values_of(discs.apart)), d = reach;
  if (!(square < d * d)) return;
  if (square <= COINCIDENT * d * COINCIDENT * d || contact.n_bonds == BONDS) {
    contact = without_bonds<D, S, BONDS>(ContactStatus::CROSSING);
    return;
  }
  contact.status = ContactStatus::TOUCHING;
  Bond<D, S> &bond = contact.bond[contact.n_bonds++];
  const S distance = norm(discs.apart), overlap = (reach - distance) / reach;
  bond.normal = (1.0 / distance) * discs.apart;
  // In dual numbers the slope of the law is held constant: `own_stiffness` accounts for it.
  bond.force = (law.energy_gradient(constant(overlap)) / reach) * bond.normal;
  bond.arm_i = discs.arm_i - (discs.radius_i / reach * distance) * bond.normal;  // in the overlap
  bond.lever_i = cross(discs.arm_i, bond.normal);
  bond.lever_j = -cross(discs.arm_j, bond.normal);
  bond.distance = distance;
  bond.reach = reach;
  bond.energy = law.energy(overlap);
  bond.stiffness = bond.own_stiffness = law.energy_hessian(overlap) / (reach * reach);
  bond.coupling = 0.0;
  bond.on_side_i = bond.on_side_j = false;
  contact.energy += bond.energy;
  contact.force += bond.force;
  contact.torque_i += cross(discs.arm_i, bond.force);
  contact.torque_j -= cross(discs.arm_j, bond.force);
}

}  // namespace jamshape
