#pragma once

#include "contact/vec.hpp"

namespace jamshape {

/// What a pair of particles is to each other. CROSSING is no contact that could be computed: spines
/// (or centres) lie on each other, and no normal exists.
enum class ContactStatus { APART, TOUCHING, CROSSING };

/// Classes of contact (Marschall & Teitel 2018, Fig. 1). The numbers are the column `kind` of
/// `compute contact/local` and of the Python bindings.
enum class ContactKind { TIP_TO_TIP = 0, TIP_TO_SIDE = 1, SIDE_TO_SIDE = 2 };

/// One point of contact that carries one force. Vectors are in space coordinates.
template <int D> struct Bond {
  Vec<D> normal;     // unit, into i
  Vec<D> force;      // on i; j carries the opposite
  Vec<D> arm_i;      // from the centre of i to the point of contact
  double distance;   // the r of the overlap 1 - r/d
  double reach;      // the d of it
  double energy;     // this bond's share of the contact's energy
  double stiffness;  // its second derivative with respect to the distance
  bool on_side_i;    // the foot lies strictly inside the flat part of i
  bool on_side_j;
};

/// Energy of one pair with its exact derivatives: force on i (j carries the opposite) and the
/// torques about the two centres. At most two bonds.
template <int D> struct Contact {
  ContactStatus status;
  ContactKind kind;
  int n_bonds;
  Bond<D> bond[2];
  double energy;
  Vec<D> force;
  Torque<D> torque_i;
  Torque<D> torque_j;
};

/// What the drag on the substrate needs of a particle (Marschall & Teitel 2018, Eqs. 8-12): its
/// area (volume in 3D) and, per body axis, the integral of the squared distance from that axis over
/// it, divided by it (their I, Eq. 10, about z in 2D).
struct SubstrateDrag {
  double measure;
  Vec<3> moment;
};

}  // namespace jamshape
