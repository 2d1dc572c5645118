#pragma once

// The only file that knows the differences between LAMMPS versions and the gaps in their installed
// headers: non-virtual member functions that liblammps exports but no installed header declares.
// Where versions use different names, the compiler selects the existing one.

#include "lammps.h"

// The class of deck commands, whose header Debian 12 does not install.
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
  /// Quaternions (w, i, j, k) of the listed atoms, except those without an ellipsoid.
  int pack_comm_bonus(int n, int *list, double *buf);
  void unpack_comm_bonus(int n, int first, double *buf);
  /// For an atom with an ellipsoid: 1, three semi-axes, quaternion, and any version-specific data;
  /// without one: 0. Returns the number of values.
  int pack_border_bonus(int n, int *list, double *buf);
  /// Sets three semi-axes, for an atom with an ellipsoid or without.
  void set_shape(int i, double a, double b, double c);
};

class Min {
 public:
  /// Requests `ndof` more degrees of freedom per atom from LAMMPS's minimiser, stored by the pair
  /// style.
  int request(Pair *pair, int ndof, double maxmove);
};

/// Sends atoms to their ranks, however far away these are.
class Irregular {
 public:
  explicit Irregular(LAMMPS *lmp);
  ~Irregular();
  /// Positions are fractions of the cell's edges; none of the arguments is needed.
  void migrate_atoms(int sorted, int assigned, int *ranks);

 private:
  alignas(64) unsigned char members[4096];  // size of LAMMPS's own: a few hundred bytes
};

}  // namespace LAMMPS_NS

extern "C" int lammps_version(void *handle);

namespace jamshape::compat {

/// An atom style's object as AtomVecEllipsoid, or null if it is of another class: determined from
/// the object itself, since no header declares the layout of the two classes.
LAMMPS_NS::AtomVecEllipsoid *as_ellipsoids(LAMMPS_NS::AtomVec *style);

/// Sends n numbers per particle of a fix to ghosts: `forward_comm_fix` until 2021.
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

/// Whether any fix changes forces: the count was public until 2021; later there is a flag beside
/// it.
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

/// Number of regions defined by the deck: a public counter until 2022.
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

/// The interface of `plugin load`, as in the PLUGIN package's header, which is not installed.
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
