#pragma once

// The only file that knows the differences between LAMMPS versions and the gaps in their installed
// headers: non-virtual member functions that liblammps exports but no installed header declares.
// Where versions use different names, the compiler selects the existing one.

#include "lammps.h"

#include <vector>

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

// The newest LAMMPS that the tests have run with.
#define JAMSHAPE_NEWEST_TESTED 20260704

namespace LAMMPS_NS {

class AtomVec;
class LAMMPS;
class Pair;

class AtomVecEllipsoid {
 public:
  /// Quaternions (w, i, j, k) of the listed atoms, except those without an ellipsoid.
  int pack_comm_bonus(int n, int *list, double *buf);
  void unpack_comm_bonus(int n, int first, double *buf);
  /// Packs 1, three semi-axes, quaternion and any version-specific data of an atom with an
  /// ellipsoid, 0 of one without. Returns the number of values.
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

/// Functions of LAMMPS's library that all versions have.
extern "C" {
int lammps_version(void *handle);
int lammps_extract_setting(void *handle, const char *keyword);
int lammps_has_style(void *handle, const char *category, const char *name);
}

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

/// Defines a function of one of LAMMPS's objects, `of`, as the first of two expressions that this
/// version compiles.
#define JAMSHAPE_EITHER(name, newer, older)                                                        \
  template <class T> auto name(T *of, int) -> decltype((newer)) { return newer; }                  \
  template <class T> auto name(T *of, long) -> decltype((older)) { return older; }                 \
  template <class T> decltype(auto) name(T *of) { return name(of, 0); }

/// Number of regions defined by the deck: a public counter until 2022.
JAMSHAPE_EITHER(n_regions, of->get_region_list().size(), of->nregion)

/// The fixes and computes of LAMMPS's Modify: public arrays until 2026.
JAMSHAPE_EITHER(fixes, std::vector(of->get_fix_list()), std::vector(of->fix, of->fix + of->nfix))
JAMSHAPE_EITHER(computes, std::vector(of->get_compute_list()),
                std::vector(of->compute, of->compute + of->ncompute))

/// The creators of styles by name: a registry of the process since the summer of 2026, before then
/// a table of each instance.
JAMSHAPE_EITHER(pair_styles, of->pair_styles(), of->pair_map)
JAMSHAPE_EITHER(fix_styles, of->fix_styles(), of->fix_map)
JAMSHAPE_EITHER(compute_styles, of->compute_styles(), of->compute_map)
JAMSHAPE_EITHER(command_styles, of->command_styles(), of->command_map)

#undef JAMSHAPE_EITHER

/// Adds a style to one of them, in place of an earlier one of its name.
template <class Styles, class Creator>
auto add_style(Styles &styles, const char *name, Creator creator)
    -> decltype(styles.set_plugin(name, creator))
{
  styles.set_plugin(name, creator);
}
template <class Styles, class Creator>
auto add_style(Styles *styles, const char *name, Creator creator)
    -> decltype(void((*styles)[name] = creator))
{
  (*styles)[name] = creator;
}

/// Requests a half neighbour list of a pair style: by `request` until 2022.
template <class Neighbor, class Pair>
auto request_list(Neighbor *neighbor, Pair *pair, int)
    -> decltype(void(neighbor->add_request(pair)))
{
  neighbor->add_request(pair);
}
template <class Neighbor, class Pair>
auto request_list(Neighbor *neighbor, Pair *pair, long instance)
    -> decltype(void(neighbor->request(pair, instance)))
{
  neighbor->request(pair, static_cast<int>(instance));
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
