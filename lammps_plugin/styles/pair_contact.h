#pragma once

#include "contact/contact.hpp"
#include "contact/instruction_set.hpp"
#include "contact/math/upper.hpp"
#include "contact/math/vec.hpp"
#include "contact/power_law.hpp"

#include "pair.h"
#include "particle_view.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace jamshape {

/// One bond between own atom i and own or ghost atom j (local indices); the normal points into i.
struct LocalBond {
  int i, j;
  ContactKind kind;
  int number;  // 0 for the first of a contact
  Vec<3> normal, force, arm_i, arm_j;
  double distance, reach, energy, stiffness;
  bool on_side_i, on_side_j;
  OnFaces on_faces;
};

/// Second derivatives of a contact's energy with respect to x_i - x_j and the rotations of i and of
/// j (4 variables in 2D, 9 in 3D): the lower triangle, row by row.
struct LocalCurvature {
  int i, j;
  const std::vector<double> &triangle;
};

/// Factories of the pair styles by name; the .cpp of each style adds its own.
std::map<std::string, LAMMPS_NS::Pair *(*)(LAMMPS_NS::LAMMPS *)> &pair_styles();

/// Base of the pair styles of all shapes: coefficients, cutoffs from the particles' sizes,
/// restarts, and orientation as extra degrees of freedom of LAMMPS's minimisers. The loop over
/// contacts is in PairContactOf.
class PairContact : public LAMMPS_NS::Pair {
 public:
  explicit PairContact(LAMMPS_NS::LAMMPS *lmp);
  ~PairContact() override;

  /// The pair style in use, null if it is not one of this plugin.
  static PairContact *find(LAMMPS_NS::LAMMPS *lmp);
  /// The same; stops with an error on behalf of `who` if it is not one of this plugin.
  static PairContact &of(LAMMPS_NS::LAMMPS *lmp, const std::string &who);
  /// The same, and stops with an error if its contacts are not those of the present atoms.
  static PairContact &evaluated(LAMMPS_NS::LAMMPS *lmp, const std::string &who);

  void settings(int narg, char **arg) override;
  void coeff(int narg, char **arg) override;
  void init_style() override;
  double init_one(int i, int j) override;
  void setup() override;
  void write_restart_settings(FILE *fp) override;
  void read_restart_settings(FILE *fp) override;
  void write_restart(FILE *fp) override;
  void read_restart(FILE *fp) override;
  void write_data(FILE *fp) override;
  void write_data_all(FILE *fp) override;
  /// The coefficients of all pairs of types, a line each, without numbers of a type that are
  /// longer.
  void write_pairs(FILE *fp, std::size_t longest) const;
  void *extract(const char *name, int &dimension) override;
  double memory_usage() override;

  void min_xf_pointers(int ignore, double **x, double **f) override;
  void min_xf_get(int ignore) override;
  void min_x_set(int ignore) override;

  /// Drag coefficients of a particle of a type, and whether any contact of the present particles
  /// can rotate one.
  virtual SubstrateDrag drag(const Vec<3> &semi_axes, int type) const = 0;
  /// Distance from a particle's surface to a core that no other may enter, if below its semi-axes.
  virtual double rim(const Vec<3> &, int) const { return INFINITY; }
  bool particles_turn() const { return any_turns; }

  /// Settings behind the name of the style that determine its energy, with a space before.
  virtual std::string settings_text() const;

  /// Report of the work skipped for the present particles, as in the log; empty before the first
  /// evaluation.
  const std::string &left_out() const { return said; }

  /// The body axis (0, 1, 2) that gives a particle's direction; nothing for particles without one.
  virtual std::optional<int> director(const Vec<3> &semi_axes, int type) const = 0;
  /// Whether all three axes of the bodies are distinguished, as for the cubatic order.
  virtual bool has_three_axes() const { return false; }

  /// Whether each bond constrains a particle like a contact, in the definition of rattlers.
  virtual bool bonds_are_contacts() const = 0;

  /// Calls `visit` for every bond of this rank's pairs, at the current positions.
  virtual void for_each_bond(const std::function<void(const LocalBond &)> &visit) = 0;
  /// Calls `visit` with the second derivatives of every contact of this rank's pairs, prestress
  /// included. Costs `curvature_cost` times as much as forces.
  virtual void for_each_curvature(const std::function<void(const LocalCurvature &)> &visit) = 0;
  virtual int curvature_cost() const = 0;
  /// False if forces jump: next to a jump the second derivative does not measure stiffness.
  virtual bool has_smooth_forces() const { return true; }
  /// Each bond once over all ranks and with tag[i] <= tag[j].
  std::vector<LocalBond> reported_bonds();

  /// Largest stiffness of a contact, over all pairs of types.
  double largest_energy() const;

  const ParticleView &particle_view() const { return particles; }

 protected:
  /// The present cell of LAMMPS's box.
  Upper cell() const;
  ParticleView particles;
  double **k_e;
  double power = HARMONIC;  // of the overlap in the energy of a bond
  bool any_turns;
  InstructionSet instructions;
  /// Shortcuts disabled although the present particles do not need the general path: for tests and
  /// timings.
  struct DisabledShortcuts {
    bool rotation = false, pairs = false, contact = false;
  } disabled;

  /// Reads the settings common to all shapes: '[law LAW] [disable_shortcuts WHAT ...]'.
  void read_settings(int narg, char **arg);
  /// Reads 'disable_shortcuts WHAT ...', or nothing without arguments.
  void read_disabled_shortcuts(int narg, char **arg);
  /// Whether a word begins them: 'general' is the name of jamshape 0.1.
  static bool begins_shortcuts(const std::string &word);
  /// Whether a word begins the settings common to all shapes.
  static bool begins_settings(const std::string &word);

  /// Names of the style, of its energy and of the objects without a contact force, in messages.
  virtual std::string style_name() const = 0;
  virtual std::string settings_rule() const { return "'law LAW' or no arguments: leave them out"; }
  virtual std::string energy_name() const { return "k_e"; }
  virtual std::string without_force() const { return "crossing spines or coinciding centres"; }

  /// Whether the contacts of the last evaluation are those of the present atoms.
  virtual bool has_current_contacts() const = 0;

  /// The numbers of a type beside its size, as they follow the energy in 'pair_coeff I I'.
  const FormNumbers &form(int type) const { return form_of[type]; }
  /// Takes the numbers of a type; returns false, and changes nothing, if they are invalid.
  virtual bool take_form(int type, const FormNumbers &numbers) = 0;
  /// Name of these numbers, empty for shapes without, and a description of the required ones.
  virtual std::string form_name() const = 0;
  /// The exponents n1 and n2 of a type, which an atom may have as well.
  virtual std::array<double, 2> exponents(int) const { return {2.0, 2.0}; }
  virtual std::string form_rule() const = 0;

  /// Checks one shape and returns a description of the required one.
  virtual bool is_valid_shape(const Vec<3> &semi_axes, int type) const = 0;
  virtual std::string shape_rule() const = 0;
  virtual bool turns(const Vec<3> &semi_axes, int type) const = 0;
  virtual Shortcut shortcut(const Vec<3> &semi_axes, int type) const = 0;
  virtual double bounding_radius(const Vec<3> &semi_axes, int type) const = 0;

  void require_arguments(bool is_right, int narg) const;

  [[noreturn]] void stop_at_crossing(int i, int j);
  [[noreturn]] void stop_at_unconverged(int i, int j);
  /// Whether this style is responsible for an atom: in a hybrid pair style, for those of its types.
  bool handles(int i) const { return is_ours[atom->type[i]]; }
  void require_shape(int i, const Vec<3> &semi_axes) const;
  [[noreturn]] void stop_at_shape(const Vec<3> &semi_axes, const std::string &which) const;
  void require_same_bound(int i, const Vec<3> &semi_axes) const;
  void require_exponents(int i) const;
  [[noreturn]] void stop_at_unexpected_turns(int i) const;
  /// Whether special_bonds keeps the pair (i, j) of LAMMPS's list in the sum.
  bool has_full_weight(int i, int listed) const
  {
    const int which = sbmask(listed);
    return which == 0 || special_weight(i, listed & NEIGHMASK, which) != 0.0;
  }
  /// Largest sum of two bounding radii.
  double largest_reach() const;
  void require_numbers(int n) const;
  void require_in_plane(int n) const;

  /// At the first evaluation of a run: writes the report of skipped work to the log if it has
  /// changed. `listed` pairs were in LAMMPS's list of this rank, `close` of them are kept.
  void report_left_out(double listed, double close);

  /// Whether this rank reports the pair (own i, j): with newton off both owners have it.
  bool is_mine(int i, int j) const;

 private:
  std::vector<FormNumbers> form_of;      // per type, from 1
  std::vector<char> is_ours;             // per type: whether this style acts on its particles
  std::vector<double> largest_radius;    // per type: bounding radius of the largest particle
  std::vector<double> x_extra, f_extra;  // rotations as lengths, for the minimiser
  std::vector<double> gyration;          // length per radian of each own particle
  std::vector<char> is_held;             // whether a minimisation keeps the pose of an own particle
  bool any_round, any_ellipsoids;
  bool is_new_run;
  std::string told, said;  // the last line in the log, without and with its numbers

  void allocate();
  int read_law(int narg, char **arg);
  std::string coeff_rule() const;
  void read_form(int narg, char **arg);
  bool read_numbers(const std::string &name, FormNumbers &numbers) const;
  void set_form(int type, const FormNumbers &numbers, const std::string &text);
  void write_forms(FILE *fp) const;
  void read_forms(FILE *fp);
  std::string more_coefficients(int type, std::size_t longest) const;
  void require_lasting_types() const;
  void choose_instructions();
  void measure_particles();
  void require_energy(double energy, const std::string &text, const std::string &where) const;
  double special_weight(int i, int j, int which) const;
  void require_orientations_of_rerun() const;
  void request_minimiser();
  void require_held_in_minimisation() const;
  void require_only_one_turns() const;
  void find_held();
  int rotations() const;
  std::vector<std::string> spared() const;
};

}  // namespace jamshape
