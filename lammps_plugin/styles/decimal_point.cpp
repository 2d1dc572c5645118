#include "decimal_point.h"

#include "comm.h"
#include "compat.h"
#include "domain.h"
#include "error.h"

#include <clocale>
#include <cstring>
#include <langinfo.h>
#include <locale.h>
#ifdef __APPLE__
#include <xlocale.h>
#endif

namespace jamshape {

namespace {

bool has_decimal_point() { return std::strcmp(nl_langinfo(RADIXCHAR), ".") == 0; }

constexpr const char *FOUND = " found a decimal comma (LC_NUMERIC of the program that runs LAMMPS)";

}  // namespace

void give_decimal_point(LAMMPS_NS::LAMMPS *lmp)
{
  if (has_decimal_point()) return;
  if (lmp->domain->box_exist || compat::n_regions(lmp->domain) > 0) {
    lmp->error->all(FLERR, std::string("jamshape") + FOUND +
                               " after LAMMPS had read numbers, 0.5 as 0, expected a decimal "
                               "point: load the plugin first, or set LC_NUMERIC to C.");
  }
  // Set permanently, because later commands cannot be wrapped.
  uselocale(newlocale(LC_NUMERIC_MASK, "C", duplocale(uselocale(locale_t(0)))));
  if (lmp->comm->me == 0) {
    lmp->error->warning(FLERR, std::string("jamshape") + FOUND +
                                   ", with which LAMMPS reads 0.5 as 0, and set a point for this "
                                   "thread; numbers before this line were read with the comma");
  }
}

void require_decimal_point(LAMMPS_NS::LAMMPS *lmp, const std::string &who)
{
  if (has_decimal_point()) return;
  lmp->error->all(FLERR, who + FOUND +
                             ", with which LAMMPS reads 0.5 as 0, expected a decimal point: set "
                             "LC_NUMERIC to C before LAMMPS reads numbers.");
}

}  // namespace jamshape
