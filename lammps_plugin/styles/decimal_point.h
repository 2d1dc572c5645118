#pragma once

#include "lammps.h"

#include <string>

namespace jamshape {

/// LAMMPS reads and writes numbers by the C library, which takes 0.5 for 0 where the program around
/// it has set a decimal comma (LC_NUMERIC). At registration: gives this thread a decimal point,
/// with a warning; stops with one sentence where numbers may have been read already.
void give_decimal_point(LAMMPS_NS::LAMMPS *lmp);

/// Stops with one sentence under a decimal comma, which was set after registration.
void require_decimal_point(LAMMPS_NS::LAMMPS *lmp, const std::string &who);

}  // namespace jamshape
