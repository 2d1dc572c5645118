#pragma once

// Debian's liblammps-dev of 2026 includes this header and ships none. The class is a member of one
// that the plugin never uses, so that only its name and size are here.

#include <cstdio>

namespace LAMMPS_NS {
class SafeFilePtr {
  FILE *fp;
  bool use_pclose;
};
}  // namespace LAMMPS_NS
