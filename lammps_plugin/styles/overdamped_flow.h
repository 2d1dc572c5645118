#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "affine_box.h"
#include "fix.h"

#include <functional>
#include <string>
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
                 LAMMPS_NS::Fix *owner, int n_registers);
  ~OverdampedFlow() override;

  /* set-up */

  /// False when particles are not where the last run left them.
  bool begin_run();
  /// Strain of a step that pushes touching particles into each other by half their radius, as far
  /// as forces may move them in a step; over all particles, after `begin_run`.
  double largest_strain() const;
  /// Drag coefficients of own atoms; after every exchange of atoms.
  void measure_particles();

  /* stages of a step, for integrators: from `hold_start` to `finish_step`, coordinates at the start
     of the step, rates stored with `store_rates` and registers stay with their atoms on whatever
     rank. Scales are those of the box, L / L(strain 0) */

  /// The present state is where every move starts, until the step is finished.
  void hold_start();
  /// Stores the rates of the present forces, which belong to the box of this scale.
  void store_rates(double scale);
  /// Moves every particle from its coordinates at the start of the step, into the box `to`, by
  ///
  ///     stored * (stored rate) + present * (rate of the present forces in the box `from`)
  ///       + last * (displacement of the last move) + before * (of the one before it)
  ///
  /// The last two need registers.
  struct Move {
    double stored, present;
    double from, to;
    double last = 0.0, before = 0.0;
  };
  /// Without registers, stops the run at a move of more than half a radius; `allow_retries` makes
  /// it return false on all ranks, at a quarter of it, turns included: nothing can be passed
  /// through then, and another move may follow.
  bool move_by(const Move &move);
  void allow_retries() { can_retry = true; }
  /// As move_by, and makes it the state.
  void finish_step(const Move &move);
  /// The same sum as a length: rms over all particles that a force moves, turns times the radius of
  /// gyration.
  double rms_of(const Move &sum);
  /// With registers, from the last `rms_of`: by how much the rates changed over the last move, over
  /// that move, where the sum was large. Of the order of the largest relaxation rate when the step
  /// is unstable, whatever makes it so; below it in smooth motion.
  double rate_seen() const { return seen; }
  /// Forces at the present positions, neighbour lists kept valid. Counts as one evaluation.
  void evaluate_forces();
  /// LAMMPS's own.
  void count_evaluation() { ++evaluations; }

  /* numbers about the flow */

  /// Largest relaxation rate: the largest eigenvalue of mobility times stiffness, by Lanczos'
  /// method, from below. Needs the place of the stored rates. Of the bonds: without the prestress,
  /// so that kinks of the energy, where second derivatives blow up, do not enter; but for long
  /// nearly parallel rods in 3D the true rate may be twice, for nearly round ones in the plane
  /// several times this one.
  double largest_rate_of_bonds();
  /// Of the whole second derivative, where forces have no jumps, else of the bonds. Ends when an
  /// iteration adds less than this fraction.
  double largest_rate(double tolerance);
  /// Means over all bonds.
  struct Touching {
    double bonds;    // how many
    double overlap;  // [length]
    double reach;    // distance of first touch [length]
    double rate;     // with which a single contact of two particles like the first relaxes [1/time]
  };
  Touching touching();
  double largest_edge() const;
  /// Ends the run, on all ranks, with a sentence about the fix.
  [[noreturn]] void stop(const std::string &found) const;
  /// Power that the drag takes: sum F^2/(k_d A) + tau^2/(k_d A I), over all ranks.
  double dissipated_power() const;
  /// Largest distance between the end of the last step and where the stored rates alone had led: of
  /// the order of the local error of Euler's method, a bound of Heun's.
  double stage_difference() const;
  /// Passes over all contacts: forces, and what estimates need.
  LAMMPS_NS::bigint n_evaluations() const { return evaluations; }
  LAMMPS_NS::bigint n_rebuilds() const { return rebuilds; }

  /* storage that travels with the atoms; the fix hands LAMMPS's calls on */

  void grow(int nmax);
  void copy(int from, int to);
  void set(int i);
  int pack(int i, double *buf) const;
  int unpack(int i, const double *buf);
  int n_coordinates() const { return dimension; }
  double *coordinates(int i) { return row(i); }
  int width() const { return dimension + n_rates + n_turns + n_registers * n_rates; }
  double memory_usage() const;

  /* the direction of the Lanczos iteration, sent to ghosts */

  int pack_direction(int n, const int *list, double *buf) const;
  void unpack_direction(int n, int first, const double *buf);

 private:
  const double drag;
  const AffineBox &box;
  const int dimension, n_rates, n_turns, n_registers;
  PairContact *pair;
  // Per atom: coordinates, rates of the stored stage, orientation at the step's start, registers
  // (displacements of the last move and of the one before).
  double *values;
  bool can_retry;
  double farthest;  // of the last move, over what is allowed
  double seen;
  double largest_difference;
  LAMMPS_NS::bigint evaluations, rebuilds;
  LAMMPS_NS::Fix *fix;

  struct Mobility {
    double shift;
    Vec<3> turn;        // per body axis
    double step_limit;  // no particle may move farther in one step than this
    double longest;     // semi-axis: what a turn moves at most
    double gyration;    // length that a radian stands for
  };
  std::vector<Mobility> mobilities;  // of each kind of particle
  std::vector<int> kind;             // of own atoms
  std::vector<double> directions;    // of own and ghost atoms, while the Lanczos iteration runs

  double *row(int i) const { return values + static_cast<std::size_t>(width()) * i; }

  Mobility mobility_of(const Vec<3> &semi_axes, int type) const;
  /// Force and torque (in the places of a rate) that move a particle at a rate.
  Rate resistance_times(int i, const Rate &rate) const;
  Rate mobility_times(int i, const Vec<3> &force, const Vec<3> &torque) const;
  Rate present_rate(int i) const;
  Rate stored_rate(int i) const;
  Rate register_of(int i, int which) const;
  void store_rate(int i, const Rate &rate);
  Rate direction(int i) const;
  void write_rate(double *to, const Rate &rate) const;
  Rate sum_of(int i, const Move &move) const;
  double length_of(int i, const Rate &of, double scale) const;
  void require_small(int i, const Rate &moved, double scale);
  Vec<3> read_coordinates(int i) const;
  Quaternion orientation_at_start(int i) const;
  double place(int i, const Move &move, bool is_last);
  void move(const Move &move, bool is_last);
  void clear_forces(int first);
  void set_force(int i, double factor, const Rate &rate);
  void add_force(int i, double factor, const Rate &rate);
  double sum(double mine) const;
  void pack_force(int i, double *to) const;
  void unpack_force(int i, const double *from);
  double largest_eigenvalue_of(const std::function<void()> &add_stiffness_times, double tolerance);
  void send_direction();
  void add_load(int i, const Vec<3> &force_on, const Vec<3> &torque_on);
  void add_bonds_times_direction();
  /// Second derivatives of all contacts, to be applied many times.
  struct Curvatures {
    std::vector<int> i, j;
    std::vector<double> triangles;
  };
  Curvatures curvatures();
  void add_curvatures_times_direction(const Curvatures &of);
  template <int D> void add_curvatures_times(const Curvatures &of);
  void rebuild_lists();
};

}  // namespace jamshape
