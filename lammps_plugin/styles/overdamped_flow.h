#pragma once

#include "contact/rotation.hpp"
#include "contact/vec.hpp"

#include "affine_box.h"
#include "fix.h"

#include <vector>

namespace jamshape {

class PairContact;

/// Velocity and angular velocity of a particle relative to the affine motion, in space coordinates.
struct Rate {
  Vec<3> shift, turn;
};

/// The equations of motion (Marschall & Teitel 2018, Eqs. 11-14): what an integrator can ask of the
/// particles. Positions are held in coordinates of the box of strain 0, in which the affine motion
/// vanishes exactly and only forces move a particle; these coordinates are the state.
class OverdampedFlow : protected LAMMPS_NS::Pointers {
 public:
  OverdampedFlow(LAMMPS_NS::LAMMPS *lmp, double k_d, const AffineBox &affine_box,
                 LAMMPS_NS::Fix *owner);
  ~OverdampedFlow() override;

  /* set-up */

  void begin_run();
  /// Drag coefficients of own atoms; after every exchange of atoms.
  void measure_particles();

  /* stages of a step, for integrators: between `begin_step` and the last `move_to`, coordinates at
     the start of the step and rates stored with `store_rates` stay with their atoms on whatever
     rank */

  struct Stage {
    LAMMPS_NS::bigint step;  // whose box the coordinates live in
    double scale;
  };
  void begin_step();
  /// Stores the rates of the present forces, which belong to the box of `stage`.
  void store_rates(const Stage &stage);
  /// Moves every particle from its coordinates at the start of the step by
  /// h * (a * stored rate + b * rate of the present forces in the box `present`), into the box
  /// `target`.
  struct Move {
    double h, a, b;
    Stage present, target;
  };
  void move_by(const Move &move);
  /// As move_by, and makes it the state.
  void finish_step(const Move &move);
  /// Forces at the present positions, neighbour lists kept valid. Counts as one evaluation.
  void evaluate_forces();

  /* numbers about the flow */

  /// Largest relaxation rate: the largest eigenvalue of mobility times stiffness (the second
  /// derivative of the energy without the prestress), by Lanczos' method, from below. Kinks of the
  /// energy, where differences of forces blow up, do not enter. The prestress is smaller by the
  /// overlap, but for long nearly parallel rods in 3D, whose true rate may be twice this one.
  double largest_rate();
  /// Power that the drag takes: sum F^2/(k_d A) + tau^2/(k_d A I), over all ranks.
  double dissipated_power() const;
  /// Largest distance between the end of the last step and where the stored rates alone had led: of
  /// the order of the local error of Euler's method, a bound of Heun's.
  double stage_difference() const;
  LAMMPS_NS::bigint n_evaluations() const { return evaluations; }
  LAMMPS_NS::bigint n_rebuilds() const { return rebuilds; }

  /* storage that travels with the atoms; the fix hands LAMMPS's calls on */

  void grow(int nmax);
  void copy(int from, int to);
  void set(int i);
  int pack(int i, double *buf) const;
  int unpack(int i, const double *buf);
  int n_coordinates() const { return dimension; }
  double *coordinates(int i) { return values[i]; }
  int width() const { return dimension + n_rates + n_turns; }
  double memory_usage() const;

  /* the direction of the Lanczos iteration, sent to ghosts */

  int pack_direction(int n, const int *list, double *buf) const;
  void unpack_direction(int n, int first, const double *buf);

 private:
  const double drag;
  const AffineBox &box;
  const int dimension, n_rates, n_turns;
  PairContact *pair;
  double *
      *values;  // per atom: coordinates, rates of the stored stage, orientation at the step's start
  double largest_difference;
  LAMMPS_NS::bigint evaluations, rebuilds;
  LAMMPS_NS::Fix *fix;

  struct Mobility {
    double shift;
    Vec<3> turn;        // per body axis
    double step_limit;  // no particle may move farther in one step than this
  };
  std::vector<Mobility> mobilities;  // of each kind of particle
  std::vector<int> kind;             // of own atoms

  Mobility mobility_of(const Vec<3> &semi_axes, int type) const;
  /// Force and torque (in the places of a rate) that move a particle at a rate.
  Rate resistance_times(int i, const Rate &rate) const;
  Rate mobility_times(int i, const Vec<3> &force, const Vec<3> &torque) const;
  Rate present_rate(int i) const;
  Rate stored_rate(int i) const;
  void store_rate(int i, const Rate &rate);
  void pack(const Rate &rate, double *to) const;
  Vec<3> read_coordinates(int i) const;
  Quaternion orientation_at_start(int i) const;
  void require_small(int i, double moved) const;
  double place(int i, const Move &move, bool is_last);
  void move(const Move &move, bool is_last);
  void clear_forces(int first);
  void set_force(int i, double factor, const Rate &rate);
  void add_force(int i, double factor, const Rate &rate);
  double sum(double mine) const;
  void pack_force(int i, double *to) const;
  void unpack_force(int i, const double *from);
  void apply_stiffness();
  void rebuild_lists();
};

}  // namespace jamshape
