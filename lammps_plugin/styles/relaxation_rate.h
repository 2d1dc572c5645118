#pragma once

#include "contact/math/vec.hpp"

#include "fix.h"
#include "mobility.h"
#include "pair_contact.h"

#include <functional>
#include <vector>

namespace jamshape {

/// Estimates the largest relaxation rate, the largest eigenvalue of mobility times stiffness, by
/// Lanczos' method, from below. It works in the force arrays and restores them.
class RelaxationRate : protected LAMMPS_NS::Pointers {
 public:
  /// Directions are sent to ghosts by the fix `owner`.
  RelaxationRate(LAMMPS_NS::LAMMPS *lmp, LAMMPS_NS::Fix *owner, const Mobilities &of);

  /// Rate of the bonds: without the prestress, so that kinks of the energy, where second
  /// derivatives diverge, do not enter; but for long nearly parallel rods in 3D the true rate may
  /// be twice, for nearly round ones in 2D several times this one.
  double of_bonds(PairContact &pair, double tolerance = 0.0);
  /// Rate of the full second derivative if forces have no jumps, else of the bonds. Stops when an
  /// iteration adds less than this fraction.
  double largest(PairContact &pair, double tolerance);

  /// Passes over all contacts used so far.
  LAMMPS_NS::bigint n_evaluations() const { return evaluations; }

  int pack_direction(int n, const int *list, double *buf) const;
  void unpack_direction(int n, int first, const double *buf);

 private:
  const int dimension, n_rates;
  const Mobilities &mobilities;
  LAMMPS_NS::Fix *fix;
  LAMMPS_NS::bigint evaluations;
  std::vector<double> directions;              // of own and ghost atoms, during an estimate
  std::vector<double> forces;                  // the present ones, to be restored
  std::vector<double> diagonal, off_diagonal;  // of the matrix in the Lanczos basis

  /// Second derivatives of all contacts, to be applied many times.
  struct Curvatures {
    std::vector<int> i, j;
    std::vector<double> triangles;
  };

  double largest_eigenvalue_of(const std::function<void()> &add_stiffness_times, double tolerance);
  void begin();
  bool next_direction(double size);
  double dot_with_forces(const std::function<Rate(int)> &rate) const;
  void end();

  Curvatures curvatures(PairContact &pair);
  void add_bonds_times_direction(PairContact &pair);
  void add_curvatures_times_direction(const Curvatures &of);
  template <int D> void add_curvatures_times(const Curvatures &of);
  Rate direction(int i) const { return read_rate(&directions[n_rates * i], dimension); }
  void send_direction();
  void add_load(int i, const Vec<3> &force_on, const Vec<3> &torque_on);
  void add_force(int i, double factor, const Rate &rate);
  void pack_force(int i, double *to) const;
  void unpack_force(int i, const double *from);
  double sum(double mine) const;
};

}  // namespace jamshape
