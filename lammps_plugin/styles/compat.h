#pragma once

// The one place that knows what differs between LAMMPS versions and what their installed headers
// leave out: non-virtual member functions that liblammps exports and no installed header declares.

#include "lammps.h"

#ifndef JAMSHAPE_LAMMPS_VERSION
#error "JAMSHAPE_LAMMPS_VERSION (such as 20210929) must be set by the build"
#endif

namespace LAMMPS_NS {

class Pair;

class AtomVecEllipsoid {
 public:
  /// Quaternions (w, i, j, k) of the listed atoms, those without an ellipsoid left out.
  int pack_comm_bonus(int n, int *list, double *buf);
  void unpack_comm_bonus(int n, int first, double *buf);
  /// An atom with an ellipsoid: 1, three semi-axes, quaternion; without one: 0.
  int pack_border_bonus(int n, int *list, double *buf);
};

class Min {
 public:
  /// Asks LAMMPS's minimiser for `ndof` more degrees of freedom an atom, kept by the pair style.
  int request(Pair *pair, int ndof, double maxmove);
};

}  // namespace LAMMPS_NS

extern "C" int lammps_version(void *handle);
