#pragma once

#include "lammps.h"

#include <string>

namespace jamshape {

/// LAMMPS reads and writes numbers with the C library, which reads 0.5 as 0 if the host program has
/// set a decimal comma (LC_NUMERIC). Called at registration: sets a decimal point for this thread,
/// with a warning; stops with an error if numbers may already have been read.
void give_decimal_point(LAMMPS_NS::LAMMPS *lmp);

/// Stops with an error if a decimal comma was set after registration.
void require_decimal_point(LAMMPS_NS::LAMMPS *lmp, const std::string &who);

}  // namespace jamshape
