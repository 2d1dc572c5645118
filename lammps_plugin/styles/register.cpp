// The plugin's table of contents: one line a style, and how LAMMPS gets to know them.

#include "compat.h"
#include "compute_contact_local.h"
#include "compute_packing.h"
#include "error.h"
#include "fix_overdamped_affine.h"
#include "force.h"
#include "modify.h"
#include "pair_dimer_harmonic.h"
#include "pair_spherocylinder_harmonic.h"
#include "pair_superellipsoid_harmonic.h"

#include <string>

#define JAMSHAPE_QUOTED(x) #x
#define JAMSHAPE_TEXT(x) JAMSHAPE_QUOTED(x)

namespace {

using LAMMPS_NS::LAMMPS;

template <class T> LAMMPS_NS::Pair *pair(LAMMPS *lmp) { return new T(lmp); }
template <class T> LAMMPS_NS::Fix *fix(LAMMPS *lmp, int narg, char **arg)
{
  return new T(lmp, narg, arg);
}
template <class T> LAMMPS_NS::Compute *compute(LAMMPS *lmp, int narg, char **arg)
{
  return new T(lmp, narg, arg);
}

void add_styles(LAMMPS *lmp)
{
  using namespace jamshape;
  (*lmp->force->pair_map)["dimer/harmonic"] = pair<PairDimerHarmonic>;
  (*lmp->force->pair_map)["spherocylinder/harmonic"] = pair<PairSpherocylinderHarmonic>;
  (*lmp->force->pair_map)["superellipsoid/harmonic"] = pair<PairSuperellipsoidHarmonic>;
  (*lmp->modify->fix_map)["overdamped/affine"] = fix<FixOverdampedAffine>;
  (*lmp->modify->compute_map)["contact/local"] = compute<ComputeContactLocal>;
  (*lmp->modify->compute_map)["packing"] = compute<ComputePacking>;
}

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

/// The LAMMPS version that this binary was compiled for, as an integer such as 20210929. (A
/// variable, so that a test can pretend to be another build.)
int jamshape_built_for = JAMSHAPE_LAMMPS_VERSION;

/// The same as text that can be found in the file, which nothing but LAMMPS can load.
extern const char jamshape_label[];
const char jamshape_label[] = "jamshape plugin for LAMMPS " JAMSHAPE_TEXT(JAMSHAPE_LAMMPS_VERSION);

/// Adds the styles of this plugin to a LAMMPS instance; stops it with one sentence when it is of
/// another version than the one compiled for, whose objects are laid out differently.
void jamshape_register(void *handle)
{
  auto *lmp = static_cast<LAMMPS *>(handle);
  const int found = lammps_version(handle);
  if (found != jamshape_built_for) {
    lmp->error->all(FLERR,
                    "jamshape found LAMMPS version " + std::to_string(found) + ", expected " +
                        std::to_string(jamshape_built_for) +
                        " for which this plugin was built: build jamshape again with this LAMMPS.");
  }
  add_styles(lmp);
}

/// What the scene at hand is spared, as in the log; empty before the first evaluation. Valid until
/// the next run.
const char *jamshape_left_out(void *handle)
{
  const auto *lmp = static_cast<LAMMPS *>(handle);
  const auto *pair = dynamic_cast<jamshape::PairContact *>(lmp->force->pair);
  return pair ? pair->left_out().c_str() : "";
}
}
#pragma GCC visibility pop
