#pragma once

// The one place that knows what differs between LAMMPS versions and what their installed headers
// leave out: non-virtual member functions that liblammps exports and no installed header declares.
// Where a version names something otherwise, the compiler is asked which name there is.

#include "lammps.h"

// The class of commands that stand in a deck, whose header Debian 12 does not install.
#if __has_include("command.h")
#include "command.h"
#else
#include "pointers.h"

namespace LAMMPS_NS {
class Command : protected Pointers {
 public:
  explicit Command(LAMMPS *lmp) : Pointers(lmp) {}
  virtual void command(int narg, char **arg) = 0;
};
}  // namespace LAMMPS_NS
#endif

#ifndef JAMSHAPE_LAMMPS_VERSION
#error "JAMSHAPE_LAMMPS_VERSION (such as 20210929) must be set by the build"
#endif

namespace LAMMPS_NS {

class AtomVec;
class LAMMPS;
class Pair;

class AtomVecEllipsoid {
 public:
  /// Quaternions (w, i, j, k) of the listed atoms, those without an ellipsoid left out.
  int pack_comm_bonus(int n, int *list, double *buf);
  void unpack_comm_bonus(int n, int first, double *buf);
  /// An atom with an ellipsoid: 1, three semi-axes, quaternion, and what a version keeps beside
  /// them; without one: 0. Returns the count of numbers.
  int pack_border_bonus(int n, int *list, double *buf);
  /// Three semi-axes, of an atom with an ellipsoid or without.
  void set_shape(int i, double a, double b, double c);
};

class Min {
 public:
  /// Asks LAMMPS's minimiser for `ndof` more degrees of freedom an atom, kept by the pair style.
  int request(Pair *pair, int ndof, double maxmove);
};

/// Sends atoms to the ranks that they belong to, however far these are.
class Irregular {
 public:
  explicit Irregular(LAMMPS *lmp);
  ~Irregular();
  /// Positions are parts of the cell's edges; none of the arguments is needed.
  void migrate_atoms(int sorted, int assigned, int *ranks);

 private:
  alignas(64) unsigned char members[4096];  // LAMMPS's own, in a few hundred bytes
};

}  // namespace LAMMPS_NS

extern "C" int lammps_version(void *handle);

namespace jamshape::compat {

/// An atom style's object as AtomVecEllipsoid, or null if it is of another class: asked of the
/// object itself, since no header says how the two classes are laid out.
LAMMPS_NS::AtomVecEllipsoid *as_ellipsoids(LAMMPS_NS::AtomVec *style);

/// Sends n numbers a particle of a fix to ghosts: `forward_comm_fix` until 2021.
template <class Comm, class Fix>
auto forward(Comm *comm, Fix *fix, int n) -> decltype(comm->forward_comm(fix, n))
{
  comm->forward_comm(fix, n);
}
template <class Comm, class Fix>
auto forward(Comm *comm, Fix *fix, int n) -> decltype(comm->forward_comm_fix(fix, n))
{
  comm->forward_comm_fix(fix, n);
}

/// Whether any fix changes forces: the count is public until 2021, later a flag beside it is.
template <class Modify>
auto has_post_force(const Modify *modify) -> decltype(modify->n_post_force_any != 0)
{
  return modify->n_post_force_any != 0;
}
template <class Modify>
auto has_post_force(const Modify *modify) -> decltype(modify->n_post_force != 0)
{
  return modify->n_post_force != 0;
}

/// Number of regions that a deck has defined: counted in public until 2022.
template <class Domain> auto n_regions(Domain *domain) -> decltype(int(domain->nregion))
{
  return domain->nregion;
}
template <class Domain>
auto n_regions(Domain *domain) -> decltype(int(domain->get_region_list().size()))
{
  return static_cast<int>(domain->get_region_list().size());
}

}  // namespace jamshape::compat

/// What the PLUGIN package's header, which is not installed, says of plugins for its `plugin load`.
extern "C" {
struct lammpsplugin_t {
  const char *version, *style, *name, *info, *author;
  union {
    void *(*v1)(void *);
    void *(*v2)(void *, int, char **);
  } creator;
  void *handle;
};
typedef void (*lammpsplugin_regfunc)(lammpsplugin_t *, void *);
}
