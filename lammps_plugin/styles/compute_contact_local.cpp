#include "compute_contact_local.h"

#include "atom.h"
#include "error.h"
#include "update.h"

#include <cstddef>
#include <map>
#include <string>

namespace jamshape {

namespace {

using Column = double (*)(const LocalBond &, const LAMMPS_NS::Atom &);
using Atom = LAMMPS_NS::Atom;

const std::map<std::string, Column> COLUMNS = {
    {"itag", [](const LocalBond &b, const Atom &a) { return static_cast<double>(a.tag[b.i]); }},
    {"jtag", [](const LocalBond &b, const Atom &a) { return static_cast<double>(a.tag[b.j]); }},
    {"kind", [](const LocalBond &b, const Atom &) { return static_cast<double>(b.kind); }},
    {"bond", [](const LocalBond &b, const Atom &) { return static_cast<double>(b.number); }},
    {"dist", [](const LocalBond &b, const Atom &) { return b.distance; }},
    {"sumrad", [](const LocalBond &b, const Atom &) { return b.reach; }},
    {"overlap", [](const LocalBond &b, const Atom &) { return (b.reach - b.distance) / b.reach; }},
    {"fx", [](const LocalBond &b, const Atom &) { return b.force[0]; }},
    {"fy", [](const LocalBond &b, const Atom &) { return b.force[1]; }},
    {"fz", [](const LocalBond &b, const Atom &) { return b.force[2]; }},
    {"rx", [](const LocalBond &b, const Atom &) { return b.arm_j[0] - b.arm_i[0]; }},
    {"ry", [](const LocalBond &b, const Atom &) { return b.arm_j[1] - b.arm_i[1]; }},
    {"rz", [](const LocalBond &b, const Atom &) { return b.arm_j[2] - b.arm_i[2]; }},
    {"nx", [](const LocalBond &b, const Atom &) { return b.normal[0]; }},
    {"ny", [](const LocalBond &b, const Atom &) { return b.normal[1]; }},
    {"nz", [](const LocalBond &b, const Atom &) { return b.normal[2]; }},
    {"cx", [](const LocalBond &b, const Atom &a) { return a.x[b.i][0] + b.arm_i[0]; }},
    {"cy", [](const LocalBond &b, const Atom &a) { return a.x[b.i][1] + b.arm_i[1]; }},
    {"cz", [](const LocalBond &b, const Atom &a) { return a.x[b.i][2] + b.arm_i[2]; }},
    {"energy", [](const LocalBond &b, const Atom &) { return b.energy; }},
    {"stiffness", [](const LocalBond &b, const Atom &) { return b.stiffness; }},
    {"sidei", [](const LocalBond &b, const Atom &) { return b.on_side_i ? 1.0 : 0.0; }},
    {"sidej", [](const LocalBond &b, const Atom &) { return b.on_side_j ? 1.0 : 0.0; }},
};

}  // namespace

ComputeContactLocal::ComputeContactLocal(LAMMPS_NS::LAMMPS *lmp, int narg, char **arg) :
    Compute(lmp, narg, arg)
{
  if (igroup != 0)
    error->all(FLERR,
               std::string("compute contact/local found a group other than all, expected 'all'."));
  if (narg < 4)
    error->all(
        FLERR,
        std::string("compute contact/local found no column, expected one or more such as itag."));
  for (int k = 3; k < narg; ++k) {
    const auto found = COLUMNS.find(arg[k]);
    if (found == COLUMNS.end()) {
      std::string names;
      for (const auto &entry : COLUMNS) names += " " + entry.first;
      error->all(FLERR, std::string("compute contact/local found column '") + arg[k] +
                            "', expected one of:" + names + ".");
    }
    columns.push_back(found->second);
  }
  local_flag = 1;
  size_local_cols = columns.size() == 1 ? 0 : static_cast<int>(columns.size());
}

void ComputeContactLocal::init() { PairContact::of(lmp, "compute contact/local"); }

void ComputeContactLocal::compute_local()
{
  invoked_local = update->ntimestep;
  const std::vector<LocalBond> bonds =
      PairContact::evaluated(lmp, "compute contact/local").reported_bonds();
  values.clear();
  for (const LocalBond &bond : bonds) {
    for (const Column column : columns) values.push_back(column(bond, *atom));
  }
  rows.resize(bonds.size());
  for (std::size_t n = 0; n < rows.size(); ++n) rows[n] = &values[n * columns.size()];
  size_local_rows = static_cast<int>(bonds.size());
  vector_local = values.data();
  array_local = rows.data();
}

double ComputeContactLocal::memory_usage()
{
  return static_cast<double>(values.capacity() * sizeof(double) +
                             rows.capacity() * sizeof(double *));
}

}  // namespace jamshape
