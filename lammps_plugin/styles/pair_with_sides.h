#pragma once

#include "comm.h"
#include "error.h"
#include "pair_contact_of.h"
#include "text.hpp"
#include "utils.h"

#include <mpi.h>
#include <string>

namespace jamshape {

/// Pair styles of shapes with straight sides: pair_style NAME sides one|two [law LAW]; pair_coeff I
/// J k_e
template <class Model> class PairWithSides : public PairContactOf<Model> {
 public:
  using PairContactOf<Model>::PairContactOf;

  /// The lever arm of the one bond jumps from end to end of parallel sides.
  bool has_smooth_forces() const override { return this->sides == Sides::TWO; }

  std::string settings_text() const override
  {
    const std::string own = this->sides == Sides::ONE ? " sides one" : " sides two";
    return own + PairContactOf<Model>::settings_text();
  }

  void settings(int narg, char **arg) override
  {
    const std::string keyword = narg >= 2 ? arg[0] : "", value = narg >= 2 ? arg[1] : "";
    const bool is_longer = narg > 2 && !this->begins_settings(arg[2]);
    if (keyword != "sides" || (value != "one" && value != "two") || is_longer) {
      this->error->all(FLERR,
                       "pair_style " + this->name() + " found '" + joined(narg, arg) +
                           "', expected 'sides one' (the dynamics' single bond) or 'sides two' "
                           "(two bonds for side-to-side contacts).");
    }
    this->sides = value == "one" ? Sides::ONE : Sides::TWO;
    this->read_settings(narg - 2, arg + 2);
  }

  void write_restart_settings(FILE *fp) override
  {
    const int value = static_cast<int>(this->sides);
    fwrite(&value, sizeof(int), 1, fp);
    PairContactOf<Model>::write_restart_settings(fp);
  }

  void read_restart_settings(FILE *fp) override
  {
    int value = 0;
    if (this->comm->me == 0) {
      LAMMPS_NS::utils::sfread(FLERR, &value, sizeof(int), 1, fp, nullptr, this->error);
    }
    MPI_Bcast(&value, 1, MPI_INT, 0, this->world);
    this->sides = static_cast<Sides>(value);
    PairContactOf<Model>::read_restart_settings(fp);
  }
};

}  // namespace jamshape
