#pragma once

#include "lammps.h"

namespace jamshape {

/// Makes a LAMMPS usable after an error in a command: what LAMMPS has deleted but not replaced is
/// replaced by LAMMPS's default, a pair style by one that refuses to run, and a fix is removed.
void mend(LAMMPS_NS::LAMMPS *lmp);

}  // namespace jamshape
