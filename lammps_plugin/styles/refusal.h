#pragma once

#include "lammps.h"

#include <string>

namespace jamshape {

/// Stops all ranks with the message of this one, as `error->one` does, and ensures that it is
/// printed.
[[noreturn]] void refuse(LAMMPS_NS::LAMMPS *lmp, const std::string &file, int line,
                         const std::string &sentence);

}  // namespace jamshape
