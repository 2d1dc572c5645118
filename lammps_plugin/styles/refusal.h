#pragma once

#include "lammps.h"

#include <string>

namespace jamshape {

/// Stops all ranks with the sentence of this one, as `error->one` does, and sees to it that it is
/// read.
[[noreturn]] void refuse(LAMMPS_NS::LAMMPS *lmp, const std::string &file, int line,
                         const std::string &sentence);

}  // namespace jamshape
