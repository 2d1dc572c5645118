#pragma once

#include "lammps.h"

namespace jamshape {

/// Makes a LAMMPS usable after an error in a command: what LAMMPS has deleted but not replaced is
/// replaced by LAMMPS's default, or removed if it is a fix.
void mend(LAMMPS_NS::LAMMPS *lmp);

}  // namespace jamshape
