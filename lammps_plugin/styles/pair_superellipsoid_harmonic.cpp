#include "contact/superellipsoid/superellipsoid.hpp"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "fix.h"
#include "modify.h"
#include "pair_contact_of.h"
#include "text.hpp"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <mpi.h>
#include <string>
#include <vector>

namespace jamshape {

namespace {

constexpr double ELLIPSOID = 1.0;  // default exponent of types

/// pair_style superellipsoid/harmonic; pair_coeff I J epsilon [p]
class PairSuperellipsoidHarmonic : public PairContactOf<SuperellipsoidModel> {
 public:
  using PairContactOf::PairContactOf;

  bool has_three_axes() const override { return true; }

  void coeff(int narg, char **arg) override;
  void init_style() override;
  void write_restart(FILE *fp) override;
  void read_restart(FILE *fp) override;

 protected:
  std::string settings_rule() const override
  {
    return "no arguments: give exponents with 'pair_coeff I I epsilon p'";
  }
  std::string energy_name() const override { return "epsilon"; }
  std::string coeff_rule() const override { return "'I J epsilon' or 'I I epsilon p'"; }
  std::string more_coefficients(int type) const override;
  std::string without_force() const override { return "coinciding centres"; }
  double exponent(int type) const override;

 private:
  std::vector<double> exponent_of;  // by type, from 1; empty while all are 1

  void read_exponent(char **arg);
};

const PairStyle<PairSuperellipsoidHarmonic> listed;

}  // namespace

double PairSuperellipsoidHarmonic::exponent(int type) const
{
  return exponent_of.empty() ? ELLIPSOID : exponent_of[type];
}

std::string PairSuperellipsoidHarmonic::more_coefficients(int type) const
{
  return " " + exactly(exponent(type));
}

void PairSuperellipsoidHarmonic::coeff(int narg, char **arg)
{
  require_arguments(narg == 3 || narg == 4, narg);
  if (narg == 4) read_exponent(arg);
  PairContactOf::coeff(3, arg);
}

void PairSuperellipsoidHarmonic::init_style()
{
  PairContactOf::init_style();
  const bool is_mixture =
      std::any_of(exponent_of.begin() + (exponent_of.empty() ? 0 : 1), exponent_of.end(),
                  [this](double p) { return p != exponent(1); });
  for (int k = 0; is_mixture && k < modify->nfix; ++k) {
    if (std::string(modify->fix[k]->style) != "atom/swap") continue;
    error->all(FLERR, std::string("pair_style superellipsoid/harmonic found fix atom/swap, which "
                                  "changes types between evaluations, expected the same p for all "
                                  "types: give it with 'pair_coeff * * epsilon p'."));
  }
}

/// An exponent belongs to a type: to all types of a line whose I and J are the same.
void PairSuperellipsoidHarmonic::read_exponent(char **arg)
{
  const std::string text = arg[3];
  int lo[2], hi[2];
  for (int k = 0; k < 2; ++k) {
    LAMMPS_NS::utils::bounds(FLERR, std::string(arg[k]), 1, atom->ntypes, lo[k], hi[k], error);
  }
  if (lo[0] != lo[1] || hi[0] != hi[1]) {
    error->all(FLERR, "pair_coeff of superellipsoid/harmonic found p = " + text + " for types " +
                          arg[0] + " and " + arg[1] +
                          ", expected p only for equal types: an exponent belongs to a type; "
                          "give it with 'pair_coeff I I epsilon p'.");
  }
  const double p = LAMMPS_NS::utils::numeric(FLERR, arg[3], false, lmp);
  if (!(p > 0.5) || !std::isfinite(p)) {
    error->all(FLERR, "pair_coeff of superellipsoid/harmonic found p = " + text +
                          ", expected a finite number above 0.5: particles of other exponents are "
                          "not convex.");
  }
  if (exponent_of.empty()) exponent_of.assign(atom->ntypes + 1, ELLIPSOID);
  std::fill(exponent_of.begin() + lo[0], exponent_of.begin() + hi[0] + 1, p);
}

void PairSuperellipsoidHarmonic::write_restart(FILE *fp)
{
  PairContactOf::write_restart(fp);
  for (int type = 1; type <= atom->ntypes; ++type) {
    const double p = exponent(type);
    fwrite(&p, sizeof(double), 1, fp);
  }
}

void PairSuperellipsoidHarmonic::read_restart(FILE *fp)
{
  PairContactOf::read_restart(fp);
  exponent_of.assign(atom->ntypes + 1, ELLIPSOID);
  double *const from = exponent_of.data() + 1;
  if (comm->me == 0) {
    LAMMPS_NS::utils::sfread(FLERR, from, sizeof(double), atom->ntypes, fp, nullptr, error);
  }
  MPI_Bcast(from, atom->ntypes, MPI_DOUBLE, 0, world);
}

}  // namespace jamshape
