#pragma once

#include "affine_box.h"
#include "pair_contact.h"

#include <array>
#include <string>

namespace jamshape {

/// Control of components of the pressure tensor P by a box that yields to it, as overdamped as the
/// particles: G_ab = (P_ab - target) / zeta, with zeta = t_box k_e N / V, while other components of
/// G are driven at their rates. The contacts of N particles with the stiffness k_e have a bulk
/// modulus of about k_e N / (D V), so that their pressure relaxes in about t_box. The deformation
/// is exp(omega) times that at the start of a substep; omega takes the stages of the particles.
///
/// The slowest relaxation of a packing at the pressure p takes about k_d d^2 / p: the force p d on
/// a particle, in 3D p d^2, moves it by its diameter d. The box alone would change by its own
/// length under p in zeta / p. Both are equal, at any p, if zeta = k_d d^2: the default, with V the
/// volume of the particles.
class BoxControl : protected LAMMPS_NS::Pointers {
 public:
  BoxControl(LAMMPS_NS::LAMMPS *lmp, double k_d);

  /* set-up */

  /// Reads 'pressure iso START STOP', 'stress ab P' or 'tbox T'. Returns the number of arguments
  /// used, 0 for any other keyword. Throws std::invalid_argument with what was found.
  int read(int k, int narg, char **arg);
  bool is_on() const { return is_isotropic || any_component(); }
  /// Replaces the driven rates; throws std::invalid_argument if one of them is of a controlled
  /// component.
  void drive(const Upper &gradient);
  /// Throws std::invalid_argument if anything is missing.
  void require_complete(bool holds_volume) const;
  bool shears() const;
  /// Takes over the velocity gradient of the box.
  void yield(AffineBox &of);
  /// Reads sizes and stiffness of the particles, on which the default time depends; at the start of
  /// a run.
  void begin_run(PairContact &of);
  /// Sets the targets of the step of LAMMPS that ends at the present one.
  void aim();

  const Upper &driven() const { return rates; }
  /// Time in which the box relaxes; NaN if that is the default, before the first run.
  double time() const { return t_box; }
  /// k_d d^2, d the diameter of a disc or sphere of the mean size; NaN before the first run.
  double host_viscosity() const;
  /// Sets the velocity gradient to that of the contacts' present stress.
  void follow();
  /// Largest relaxation rate of the box alone: a bound, from the stiffness of all bonds.
  double largest_rate() const;

  /* stages of a substep */

  /// Starts from the box at a time after a step of LAMMPS.
  void hold(LAMMPS_NS::bigint step, double after);
  /// Box after the sum of rates that OverdampedFlow::Move describes.
  Upper moved(double stored, double present, double last, double before);
  /// The same sum as a strain.
  double length_of(double stored, double present, double last) const;
  /// Makes the last box the state at a time after a step.
  void settle(LAMMPS_NS::bigint step, double after, double h);
  /// Sets the velocity gradient to that at the start of the substep, to try it again.
  void try_again() { box->set_rate(start); }

 private:
  struct Target {
    bool is_set = false;
    double from = 0.0, to = 0.0;
    std::string variable{};
    double now = 0.0;
  };
  AffineBox *box;
  const int dimension;
  Upper rates;  // of the driven components
  bool is_isotropic;
  Target pressure;
  std::array<Target, 6> components;  // xx, yy, zz, xy, xz, yz
  const double drag;
  bool is_time_given;
  double t_box, stiffness, measure;
  PairContact *pair;
  Upper start, last, before;  // rate at the start of the substep; omega of the last two stages

  bool any_component() const;
  Target read_target(const std::string &from, const std::string &to, bool is_normal) const;
  void aim(Target &at, bool is_normal) const;
  std::array<double, 6> stress_times_volume() const;
  Upper in_omega(const Upper &rate) const;
  Upper sum_of(double stored, double present, double of_last, double of_before) const;
};

}  // namespace jamshape
