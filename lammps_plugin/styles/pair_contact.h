#pragma once

#include "contact/contact.hpp"
#include "contact/instruction_set.hpp"
#include "contact/math/upper.hpp"
#include "contact/math/vec.hpp"

#include "pair.h"
#include "particle_view.h"

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

/// Second derivatives of a contact's energy by x_i - x_j and by the rotations of i and of j (in 2D
/// 4 variables, in 3D 9): the lower triangle, row by row.
struct LocalCurvature {
  int i, j;
  const std::vector<double> &triangle;
};

/// The pair styles by name, each with what makes one; every style's .cpp adds its own.
std::map<std::string, LAMMPS_NS::Pair *(*) (LAMMPS_NS::LAMMPS *)> &pair_styles();

/// What every pair style of ours is, whatever its shape: coefficients, cutoffs from the particles'
/// sizes, restarts, and orientation as extra degrees of freedom of LAMMPS's minimisers. The loop
/// over contacts is in PairContactOf.
class PairContact : public LAMMPS_NS::Pair {
 public:
  explicit PairContact(LAMMPS_NS::LAMMPS *lmp);
  ~PairContact() override;

  /// The pair style in use, null if it is none of ours.
  static PairContact *find(LAMMPS_NS::LAMMPS *lmp);
  /// The same; ends the run with a sentence about `who` asks if it is none of ours.
  static PairContact &of(LAMMPS_NS::LAMMPS *lmp, const std::string &who);
  /// The same, and with one if its contacts are not those of the present atoms.
  static PairContact &evaluated(LAMMPS_NS::LAMMPS *lmp, const std::string &who);

  void settings(int narg, char **arg) override;
  void coeff(int narg, char **arg) override;
  void init_style() override;
  double init_one(int i, int j) override;
  void setup() override;
  void write_restart(FILE *fp) override;
  void read_restart(FILE *fp) override;
  void write_data(FILE *fp) override;
  void write_data_all(FILE *fp) override;
  void *extract(const char *name, int &dimension) override;
  double memory_usage() override;

  void min_xf_pointers(int ignore, double **x, double **f) override;
  void min_xf_get(int ignore) override;
  void min_x_set(int ignore) override;

  /// Drag coefficients of a particle of a type, and whether a contact can turn any of this scene.
  virtual SubstrateDrag drag(const Vec<3> &semi_axes, int type) const = 0;
  bool particles_turn() const { return any_turns; }

  /// What this scene is spared, as it is written to the log: a sentence, empty before the first
  /// evaluation.
  const std::string &left_out() const { return said; }

  /// The body axis (0, 1, 2) that tells a particle's direction; nothing for those that have none.
  virtual std::optional<int> director(const Vec<3> &semi_axes, int type) const = 0;
  /// Whether all three axes of the bodies count, as for the cubatic order.
  virtual bool has_three_axes() const { return false; }

  /// Whether each bond holds a particle like a contact, as far as rattlers go.
  virtual bool bonds_are_contacts() const = 0;

  /// Shows every bond of this rank's pairs, at the current positions, to `visit`.
  virtual void for_each_bond(const std::function<void(const LocalBond &)> &visit) = 0;
  /// Shows the second derivatives of every contact of this rank's pairs, prestress included. Costs
  /// `curvature_cost` times as much as forces.
  virtual void for_each_curvature(const std::function<void(const LocalCurvature &)> &visit) = 0;
  virtual int curvature_cost() const = 0;
  /// False where forces jump: beside a jump the second derivative says nothing of stiffness.
  virtual bool has_smooth_forces() const { return true; }
  /// Each bond once over all ranks and with tag[i] <= tag[j].
  std::vector<LocalBond> reported_bonds();

  const ParticleView &particle_view() const { return particles; }

 protected:
  /// The present cell of LAMMPS's box.
  Upper cell() const;
  ParticleView particles;
  double **k_e;
  bool any_turns;
  InstructionSet instructions;
  /// Where the general path is taken although the scene does not need it: for tests and timings.
  struct General {
    bool rotation = false, pairs = false, contact = false;
  } general;

  /// 'general WHAT ...' from the first of these arguments on; nothing where there is none.
  void read_general(int narg, char **arg);

  /// Names the style, its energy and what has no contact force, in messages.
  virtual std::string style_name() const = 0;
  virtual std::string settings_rule() const { return "no arguments: leave them out"; }
  virtual std::string energy_name() const { return "k_e"; }
  virtual std::string coeff_rule() const { return "'I J k_e'"; }
  /// Coefficients of a type beside its energy, as they follow that in 'pair_coeff I I'.
  virtual std::string more_coefficients(int /*type*/) const { return ""; }
  virtual std::string without_force() const { return "crossing spines or coinciding centres"; }

  /// Whether the contacts of the last evaluation are those of the present atoms.
  virtual bool has_current_contacts() const = 0;

  /// Checks one shape and says what it should be. Some shapes have an exponent, by type.
  virtual double exponent(int /*type*/) const { return 1.0; }
  virtual bool is_valid_shape(const Vec<3> &semi_axes, int type) const = 0;
  virtual std::string shape_rule() const = 0;
  virtual bool turns(const Vec<3> &semi_axes, int type) const = 0;
  virtual Shortcut shortcut(const Vec<3> &semi_axes, int type) const = 0;
  virtual double bounding_radius(const Vec<3> &semi_axes, int type) const = 0;

  void require_arguments(bool is_right, int narg) const;

  [[noreturn]] void stop_at_crossing(int i, int j);
  [[noreturn]] void stop_at_unconverged(int i, int j);
  /// Whether an atom is this style's to judge: in a hybrid pair style those of its types are.
  bool handles(int i) const { return is_ours[atom->type[i]]; }
  void require_shape(int i, const Vec<3> &semi_axes) const;
  [[noreturn]] void stop_at_shape(const Vec<3> &semi_axes, const std::string &which) const;
  void require_same_bound(int i, const Vec<3> &semi_axes) const;
  [[noreturn]] void stop_at_unexpected_turns(int i) const;
  /// Whether special_bonds leaves pair (i, j), as it stands in LAMMPS's list, in the sum.
  bool has_full_weight(int i, int listed) const
  {
    const int which = sbmask(listed);
    return which == 0 || special_weight(i, listed & NEIGHMASK, which) != 0.0;
  }
  /// Largest sum of two bounding radii.
  double largest_reach() const;
  void require_numbers(int n) const;
  void require_in_plane(int n) const;

  /// At the first evaluation of a run: tells the log what was left out, when that has changed.
  /// `listed` pairs were in LAMMPS's list of this rank, `close` of them are kept.
  void report_left_out(double listed, double close);

  /// Whether the pair (own i, j) is this rank's to report: with newton off both owners see it.
  bool is_mine(int i, int j) const;

 private:
  std::vector<char> is_ours;             // per type: whether this style acts on particles of it
  std::vector<double> largest_radius;    // per type: bounding radius of the largest particle
  std::vector<double> x_extra, f_extra;  // rotations as lengths, for the minimiser
  std::vector<double> gyration;          // length per radian of each own particle
  std::vector<char> is_held;             // whether a minimisation keeps an own particle's pose
  bool any_round, any_ellipsoids;
  bool is_new_run;
  std::string told, said;  // the last line in the log, without and with its numbers

  void allocate();
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
