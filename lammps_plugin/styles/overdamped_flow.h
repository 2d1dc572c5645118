#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "affine_box.h"
#include "box_control.h"
#include "fix.h"
#include "mobility.h"
#include "relaxation_rate.h"

#include <string>
#include <vector>

namespace jamshape {

/// The equations of motion (Marschall & Teitel 2018, Eqs. 11-14), as the interface between
/// integrators and particles. Positions are held in coordinates of the box of strain 0, in which
/// the affine motion vanishes exactly and only forces move a particle; these coordinates are the
/// state.
class OverdampedFlow : protected LAMMPS_NS::Pointers {
 public:
  OverdampedFlow(LAMMPS_NS::LAMMPS *lmp, double k_d, const AffineBox &affine_box,
                 LAMMPS_NS::Fix *owner, int n_registers);
  ~OverdampedFlow() override;

  /* set-up */

  /// Returns false if particles are not where the last run left them.
  bool begin_run();
  /// Sets velocities, which overdamped motion does not have, to 0; true if there were any.
  bool stop_particles();
  /// Whether the last `begin_run` was for the present particles and pair style.
  bool knows_particles() const;
  /// Between steps: stops with an error if something else has moved a particle or given it a
  /// velocity.
  void require_untouched() const;
  /// Strain of a step that pushes touching particles into each other by half their radius, the
  /// largest displacement allowed in a step; over all particles, after `begin_run`.
  double largest_strain() const;
  /// Lets the box yield to the stress of every evaluation.
  void yield_by(BoxControl *to) { control_of_box = to; }
  BoxControl *control() const { return control_of_box; }
  /// Reads the sizes of own atoms; after every exchange of atoms.
  void measure_particles() { mobilities.measure(*pair); }

  /* stages of a step, for integrators: from `hold_start` to `finish_step`, coordinates and rates at
     the start of the step and registers stay with their atoms on whatever rank. Deformations are
     those of the box since strain 0 */

  /// Makes the present state the start of all moves until the step is finished; stores the rates of
  /// the present forces, which belong to the box of this deformation.
  void hold_start(const Upper &deformation);
  /// Moves every particle from its coordinates at the start of the step, into the box `to`, by
  ///
  ///     stored * (stored rate) + present * (rate of the present forces in the box `from`)
  ///       + last * (displacement of the last move) + before * (of the one before it)
  ///
  /// The last two need registers.
  struct Move {
    double stored, present;
    Upper from, to;
    double last = 0.0, before = 0.0;
  };
  /// Without registers, stops the run at a move of more than half a radius; with `allow_retries` it
  /// returns false on all ranks instead, at a quarter of it, rotations included: particles cannot
  /// pass through each other then, and another move may follow.
  bool move_by(const Move &move);
  void allow_retries() { can_retry = true; }
  /// `hold_start(move.from)` and `move_by(move)` in one pass over the particles.
  bool start_by(const Move &move);
  /// Like move_by, and makes the result the new state.
  void finish_step(const Move &move);
  /// Converts coordinates in the box of strain 0 to those in another one; between steps only.
  void change_reference(const Upper &factor);
  /// Corrects coordinates where LAMMPS's image counts have wrapped around.
  void follow_images();
  /// The same sum as a length: rms over all particles that a force moves, rotations times the
  /// radius of gyration.
  double rms_of(const Move &sum);
  /// With registers, from the last `rms_of`: the change of the rates over the last move, divided by
  /// that move, where the sum was large. Of the order of the largest relaxation rate if the step is
  /// unstable, for whatever reason; below it in smooth motion.
  double rate_seen() const { return seen; }
  /// Computes forces at the present positions, with valid neighbour lists. Counts as one
  /// evaluation.
  void evaluate_forces();
  /// Counts an evaluation made by LAMMPS itself.
  void count_evaluation() { ++evaluations; }

  /* numbers about the flow */

  /// Largest relaxation rates, as estimated by RelaxationRate.
  double largest_rate_of_bonds() { return relaxation.of_bonds(*pair); }
  double largest_rate(double tolerance) { return relaxation.largest(*pair, tolerance); }
  /// Means over all bonds.
  struct Touching {
    double bonds;    // number of bonds
    double overlap;  // [length]
    double reach;    // distance of first touch [length]
    double rate;     // at which a single contact of two particles like the first relaxes [1/time]
  };
  Touching touching();
  double largest_edge() const;
  /// Stops the run on all ranks with an error message of the fix.
  [[noreturn]] void stop(const std::string &found) const;
  /// Dissipated power of the drag: sum F^2/(k_d A) + tau^2/(k_d A I), over all ranks.
  double dissipated_power() const;
  /// Power of the torques on the rotation due to the host alone.
  double power_of_host() const;
  /// Mean rotation of particles about z since strain 0 [rad].
  double mean_turn() const;
  void set_mean_turn(double angle);
  /// Largest distance between the end of the last step and the position predicted by the stored
  /// rates alone: of the order of the local error of Euler's method, a bound of Heun's.
  double stage_difference() const;
  /// Number of passes over all contacts: forces, and those of estimates.
  LAMMPS_NS::bigint n_evaluations() const { return evaluations + relaxation.n_evaluations(); }
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

  /* data that the estimate of rates sends to ghosts */

  int pack_direction(int n, const int *list, double *buf) const
  {
    return relaxation.pack_direction(n, list, buf);
  }
  void unpack_direction(int n, int first, const double *buf)
  {
    relaxation.unpack_direction(n, first, buf);
  }

 private:
  const AffineBox &box;
  const int dimension, n_rates, n_turns, n_registers;
  PairContact *pair;
  BoxControl *control_of_box;
  // Per atom: coordinates, rates of the stored stage, orientation at the step's start, registers
  // (displacements of the last move and of the one before).
  double *values;
  bool can_retry;
  double farthest;       // of the last move, over the largest allowed
  double turned_so_far;  // about z, summed over the moves on this rank
  double seen;
  double largest_difference;
  LAMMPS_NS::bigint evaluations, rebuilds;
  Mobilities mobilities;
  RelaxationRate relaxation;

  double *row(int i) const { return values + static_cast<std::size_t>(width()) * i; }

  template <int D> struct Row;
  template <int D> bool is_at(int i, const AffineBox::Deformed<D> &present, double tolerance) const;
  bool is_moving(int i) const;
  template <int D> void hold(int begin, int end, const Upper &inverse);
  template <int D> struct Spins;
  bool host_turns() const;
  struct Weights;
  template <int D> RateIn<D> sum_of(const Row<D> &row, const Weights &of, RateIn<D> present) const;
  template <int D> double length_of(int i, const RateIn<D> &of, const Upper &deformation) const;
  template <int D> void require_small(int i, const RateIn<D> &moved, const Upper &deformation);
  [[noreturn]] void stop_at_long_step(int i, double distance) const;
  /// Additional work of a pass over the particles beside moving them.
  enum class Pass { MOVE, START, FINISH };
  template <int D> void move_in(const Move &move, Pass pass);
  void move(const Move &move, Pass pass);
  bool was_small() const;
  template <int D> void add_lengths(const Move &of, double *sums);
  void clear_forces();
  double sum(double mine) const;
  void rebuild_lists();
};

}  // namespace jamshape
