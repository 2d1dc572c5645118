#pragma once

#include "comm.h"
#include "error.h"
#include "pair_contact_of.h"
#include "text.hpp"
#include "utils.h"

#include <mpi.h>
#include <string>

namespace jamshape {

/// Pair styles of shapes with straight sides: pair_style NAME sides one|two; pair_coeff I J k_e
template <class Model> class PairWithSides : public PairContactOf<Model> {
 public:
  using PairContactOf<Model>::PairContactOf;

  /// The lever arm of the one bond jumps from end to end of parallel sides.
  bool has_smooth_forces() const override { return this->sides == Sides::TWO; }

  std::string settings_text() const override
  {
    return this->sides == Sides::ONE ? " sides one" : " sides two";
  }

  void settings(int narg, char **arg) override
  {
    const std::string keyword = narg >= 2 ? arg[0] : "", value = narg >= 2 ? arg[1] : "";
    const bool is_longer = narg > 2 && !this->begins_shortcuts(arg[2]);
    if (keyword != "sides" || (value != "one" && value != "two") || is_longer) {
      this->error->all(FLERR,
                       "pair_style " + this->name() + " found '" + joined(narg, arg) +
                           "', expected 'sides one' (the dynamics' single bond) or 'sides two' "
                           "(two bonds for side-to-side contacts).");
    }
    this->sides = value == "one" ? Sides::ONE : Sides::TWO;
    this->read_disabled_shortcuts(narg - 2, arg + 2);
  }

  void write_restart(FILE *fp) override
  {
    write_restart_settings(fp);
    PairContactOf<Model>::write_restart(fp);
  }

  void read_restart(FILE *fp) override
  {
    read_restart_settings(fp);
    PairContactOf<Model>::read_restart(fp);
  }

  void write_restart_settings(FILE *fp) override
  {
    const int value = static_cast<int>(this->sides);
    fwrite(&value, sizeof(int), 1, fp);
  }

  void read_restart_settings(FILE *fp) override
  {
    int value = 0;
    if (this->comm->me == 0) {
      LAMMPS_NS::utils::sfread(FLERR, &value, sizeof(int), 1, fp, nullptr, this->error);
    }
    MPI_Bcast(&value, 1, MPI_INT, 0, this->world);
    this->sides = static_cast<Sides>(value);
  }
};

}  // namespace jamshape
