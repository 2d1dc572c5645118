#include "contact/spherocylinder/spherocylinder.hpp"

#include "comm.h"
#include "error.h"
#include "pair_contact_of.h"
#include "text.hpp"
#include "utils.h"

#include <mpi.h>
#include <string>

namespace jamshape {

namespace {

/// pair_style spherocylinder/harmonic sides one|two; pair_coeff I J k_e
class PairSpherocylinderHarmonic : public PairContactOf<SpherocylinderModel> {
 public:
  using PairContactOf::PairContactOf;

  /// The lever arm of the one bond jumps from end to end of parallel rods.
  bool has_smooth_forces() const override { return sides == Sides::TWO; }

  std::string settings_text() const override
  {
    return sides == Sides::ONE ? " sides one" : " sides two";
  }

  void settings(int narg, char **arg) override;
  void write_restart(FILE *fp) override;
  void read_restart(FILE *fp) override;
  void write_restart_settings(FILE *fp) override;
  void read_restart_settings(FILE *fp) override;
};

const PairStyle<PairSpherocylinderHarmonic> listed;

}  // namespace

void PairSpherocylinderHarmonic::settings(int narg, char **arg)
{
  const std::string keyword = narg >= 2 ? arg[0] : "", value = narg >= 2 ? arg[1] : "";
  const bool is_longer = narg > 2 && !begins_shortcuts(arg[2]);
  if (keyword != "sides" || (value != "one" && value != "two") || is_longer) {
    error->all(FLERR, "pair_style spherocylinder/harmonic found '" + joined(narg, arg) +
                          "', expected 'sides one' (the dynamics' single bond) or 'sides two' (two "
                          "bonds for side-to-side contacts).");
  }
  sides = value == "one" ? Sides::ONE : Sides::TWO;
  read_disabled_shortcuts(narg - 2, arg + 2);
}

void PairSpherocylinderHarmonic::write_restart(FILE *fp)
{
  write_restart_settings(fp);
  PairContactOf::write_restart(fp);
}

void PairSpherocylinderHarmonic::read_restart(FILE *fp)
{
  read_restart_settings(fp);
  PairContactOf::read_restart(fp);
}

void PairSpherocylinderHarmonic::write_restart_settings(FILE *fp)
{
  const int value = static_cast<int>(sides);
  fwrite(&value, sizeof(int), 1, fp);
}

void PairSpherocylinderHarmonic::read_restart_settings(FILE *fp)
{
  int value = 0;
  if (comm->me == 0) LAMMPS_NS::utils::sfread(FLERR, &value, sizeof(int), 1, fp, nullptr, error);
  MPI_Bcast(&value, 1, MPI_INT, 0, world);
  sides = static_cast<Sides>(value);
}

}  // namespace jamshape
