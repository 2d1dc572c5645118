#include "pair_superellipsoid_harmonic.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <mpi.h>
#include <string>

namespace jamshape {

namespace {

constexpr double ELLIPSOID = 1.0;  // the exponent of types that were given none

/// Shapes with b^2 = ac to this are neither long nor flat.
constexpr double SELF_DUAL = 1e-9;

}  // namespace

double PairSuperellipsoidHarmonic::exponent(int type) const
{
  return exponent_of.empty() ? ELLIPSOID : exponent_of[type];
}

/// The longest axis of long particles and the shortest of flat ones (Yuan et al. 2019, Sec. 2.4);
/// the first where they are equal, as in cubes.
std::optional<int> PairSuperellipsoidHarmonic::director(const Vec<3> &semi_axes, int type) const
{
  const double *const begin = semi_axes.c, *const end = begin + domain->dimension;
  const auto range = std::minmax_element(begin, end);
  const double shortest = *range.first, longest = *range.second;
  if (shortest == longest) {
    return exponent(type) != ELLIPSOID ? std::optional<int>(0) : std::nullopt;
  }
  bool is_long = true;
  if (domain->dimension == 3) {
    const double middle = semi_axes[0] + semi_axes[1] + semi_axes[2] - shortest - longest;
    is_long = shortest * longest > (1.0 + SELF_DUAL) * middle * middle;
  }
  return static_cast<int>(std::find(begin, end, is_long ? longest : shortest) - begin);
}

void PairSuperellipsoidHarmonic::settings(int narg, char **arg)
{
  if (narg == 0 || std::string(arg[0]) == "general") return read_general(narg, arg);
  std::string found;
  for (int k = 0; k < narg; ++k) found += std::string(" ") + arg[k];
  error->all(FLERR,
             "pair_style superellipsoid/harmonic found '" + found +
                 "', expected no arguments: give exponents with 'pair_coeff I I epsilon p'.");
}

void PairSuperellipsoidHarmonic::coeff(int narg, char **arg)
{
  require_arguments(narg == 3 || narg == 4, narg);
  if (narg == 4) read_exponent(arg);
  PairContactOf::coeff(3, arg);
}

/// An exponent is of a type: of all types of a line whose I and J name the same ones.
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
                          ", expected it where both are the same: an exponent belongs to a type, "
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
