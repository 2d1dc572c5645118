#pragma once

#include "compute.h"
#include "pair_contact.h"

#include <vector>

namespace jamshape {

/// compute ID all contact/local NAME ...
///
/// One row per bond, columns in the requested order:
///   itag jtag             IDs, itag <= jtag
///   kind                  0 tip-to-tip, 1 tip-to-side, 2 side-to-side
///   bond                  number in its contact, from 0
///   dist sumrad overlap   r, d and 1 - r/d
///   fx fy fz              force on i
///   rx ry rz              vector from the centre of j to that of i
///   nx ny nz              unit normal into i
///   cx cy cz              point of contact
///   energy stiffness      V and its second derivative with respect to r
///   sidei sidej           1 if the contact lies on a face of i, of j
class ComputeContactLocal : public LAMMPS_NS::Compute {
 public:
  ComputeContactLocal(LAMMPS_NS::LAMMPS *lmp, int narg, char **arg);

  void init() override;
  void compute_local() override;
  double memory_usage() override;

 private:
  using Column = double (*)(const LocalBond &, const LAMMPS_NS::Atom &);
  std::vector<Column> columns;
  std::vector<double> values;
  std::vector<double *> rows;
};

}  // namespace jamshape
