#include "pair_contact.h"

#include "atom.h"
#include "comm.h"
#include "decimal_point.h"
#include "domain.h"
#include "error.h"
#include "fix.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "refusal.h"
#include "text.hpp"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <mpi.h>
#include <sstream>
#include <stdexcept>

namespace jamshape {

using LAMMPS_NS::bigint;

namespace {

/// Largest relative difference between two ways to compute a length.
constexpr double ROUNDING = 1e-12;

/// Largest rotation out of the plane that rounding can explain [rad]: it changes projected lengths
/// by a relative 1e-16.
constexpr double MOST_TILT = 1e-8;

/// Length of numbers of a type in a data file, of whose lines LAMMPS reads 255 characters.
constexpr std::size_t LONGEST_COEFFICIENTS = 200;

/// Powers of contact laws with names.
const std::map<std::string, double> NAMED_POWERS{{"harmonic", HARMONIC}, {"hertz", 2.5}};

/// In restart files, what precedes the power of a law that is not harmonic, where files of harmonic
/// ones have a number that is not negative.
constexpr int LAW_FOLLOWS = -1;

bool begins_with(const char *text, const char *beginning)
{
  return std::strncmp(text, beginning, std::strlen(beginning)) == 0;
}

}  // namespace

std::map<std::string, LAMMPS_NS::Pair *(*)(LAMMPS_NS::LAMMPS *)> &pair_styles()
{
  static std::map<std::string, LAMMPS_NS::Pair *(*)(LAMMPS_NS::LAMMPS *)> styles;
  return styles;
}

PairContact::PairContact(LAMMPS_NS::LAMMPS *lmp) :
    Pair(lmp), particles(lmp), k_e(nullptr), any_turns(true), instructions(InstructionSet::scalar),
    any_round(false), any_ellipsoids(false), is_new_run(false)
{
  no_virial_fdotr_compute = 1;  // sum_i x_i F_i loses digits that the pairwise sum keeps
  single_enable = 0;
  restartinfo = writedata = 1;
  centroidstressflag = LAMMPS_NS::CENTROID_NOTAVAIL;
}

PairContact::~PairContact()
{
  if (!allocated) return;
  memory->destroy(setflag);
  memory->destroy(cutsq);
  memory->destroy(k_e);
}

PairContact *PairContact::find(LAMMPS_NS::LAMMPS *lmp)
{
  return dynamic_cast<PairContact *>(lmp->force->pair);
}

PairContact &PairContact::of(LAMMPS_NS::LAMMPS *lmp, const std::string &who)
{
  auto *const pair = find(lmp);
  if (!pair) {
    const char *const style = lmp->force->pair_style;
    lmp->error->all(FLERR, who + " found pair_style " + (style ? style : "none") +
                               ", expected one of jamshape's: use 'pair_style SHAPE/harmonic'.");
  }
  return *pair;
}

PairContact &PairContact::evaluated(LAMMPS_NS::LAMMPS *lmp, const std::string &who)
{
  PairContact &pair = of(lmp, who);
  if (!pair.has_current_contacts()) {
    lmp->error->all(FLERR, who +
                               " found no contacts of the present atoms, expected those of a run: "
                               "use it after 'run 0' or another run, and again after a change of "
                               "the pair style or of the number of atoms.");
  }
  if (!lmp->atom->tag_enable) {
    lmp->error->all(FLERR, who + " found atoms without IDs, expected one for each: leave out "
                                 "'atom_modify id no'.");
  }
  return pair;
}

void PairContact::allocate()
{
  const int n = atom->ntypes + 1;
  memory->create(setflag, n, n, "pair:setflag");
  memory->create(cutsq, n, n, "pair:cutsq");
  memory->create(k_e, n, n, "pair:k_e");
  for (int i = 0; i < n; ++i) {
    std::fill_n(setflag[i], n, 0);
    std::fill_n(k_e[i], n, 0.0);
  }
  form_of.assign(n, {});
  for (int type = 1; type < n; ++type) take_form(type, {});
  allocated = 1;
}

void PairContact::settings(int narg, char **arg)
{
  if (narg == 0 || begins_settings(arg[0])) return read_settings(narg, arg);
  error->all(FLERR, "pair_style " + style_name() + " found '" + joined(narg, arg) + "', expected " +
                        settings_rule() + ".");
}

bool PairContact::begins_settings(const std::string &word)
{
  return word == "law" || begins_shortcuts(word);
}

void PairContact::read_settings(int narg, char **arg)
{
  power = HARMONIC;
  const int n_read = narg > 0 && std::string(arg[0]) == "law" ? read_law(narg, arg) : 0;
  read_disabled_shortcuts(narg - n_read, arg + n_read);
}

/// Reads 'law harmonic', 'law hertz' or 'law power A'; returns the number of words.
int PairContact::read_law(int narg, char **arg)
{
  const std::string name = narg > 1 ? arg[1] : "";
  const auto named = NAMED_POWERS.find(name);
  if (named != NAMED_POWERS.end()) {
    power = named->second;
    return 2;
  }
  if (name == "power" && narg > 2) {
    power = LAMMPS_NS::utils::numeric(FLERR, arg[2], false, lmp);
    if (power >= HARMONIC && std::isfinite(power)) return 3;
  }
  error->all(FLERR, "pair_style " + style_name() + " found '" + joined(narg, arg) +
                        "', expected 'law harmonic', 'law hertz' or 'law power A' with A >= 2: "
                        "below 2 contacts would be infinitely stiff where they open.");
}

std::string PairContact::settings_text() const
{
  if (power == HARMONIC) return "";
  for (const auto &[name, of_name] : NAMED_POWERS) {
    if (power == of_name) return " law " + name;
  }
  return " law power " + exactly(power);
}

void PairContact::coeff(int narg, char **arg)
{
  require_arguments(narg == 3 || (narg > 3 && !form_name().empty()), narg);
  if (!allocated) allocate();
  if (narg > 3) read_form(narg, arg);
  int ilo, ihi, jlo, jhi;
  LAMMPS_NS::utils::bounds(FLERR, std::string(arg[0]), 1, atom->ntypes, ilo, ihi, error);
  LAMMPS_NS::utils::bounds(FLERR, std::string(arg[1]), 1, atom->ntypes, jlo, jhi, error);
  const double stiffness = LAMMPS_NS::utils::numeric(FLERR, arg[2], false, lmp);
  require_energy(stiffness, arg[2], "pair_coeff of " + style_name());
  int n_set = 0;
  for (int i = ilo; i <= ihi; ++i) {
    for (int j = std::max(jlo, i); j <= jhi; ++j, ++n_set) {
      k_e[i][j] = k_e[j][i] = stiffness;
      setflag[i][j] = 1;
    }
  }
  if (n_set > 0) return;
  error->all(FLERR, "pair_coeff of " + style_name() + " found types '" + arg[0] + " " + arg[1] +
                        "', expected I <= J: write the smaller type first.");
}

std::string PairContact::coeff_rule() const
{
  const std::string plain = "I J " + energy_name();
  if (form_name().empty()) return "'" + plain + "'";
  return "'" + plain + "' or 'I I " + energy_name() + " " + form_name() + "'";
}

/// The numbers of a type, or of all types of a line whose I and J are the same.
void PairContact::read_form(int narg, char **arg)
{
  const std::string text = joined(narg - 3, arg + 3);
  int lo[2], hi[2];
  for (int k = 0; k < 2; ++k) {
    LAMMPS_NS::utils::bounds(FLERR, std::string(arg[k]), 1, atom->ntypes, lo[k], hi[k], error);
  }
  if (lo[0] != lo[1] || hi[0] != hi[1]) {
    error->all(FLERR, "pair_coeff of " + style_name() + " found " + form_name() + " = " + text +
                          " for types " + arg[0] + " and " + arg[1] + ", expected " + form_name() +
                          " only for equal types: it belongs to a type; give it with 'pair_coeff "
                          "I I " +
                          energy_name() + " " + form_name() + "'.");
  }
  FormNumbers numbers;
  if (narg > 4 || !read_numbers(arg[3], numbers)) {
    for (int k = 3; k < narg; ++k) {
      numbers.push_back(LAMMPS_NS::utils::numeric(FLERR, arg[k], false, lmp));
    }
  }
  for (int type = lo[0]; type <= hi[0]; ++type) set_form(type, numbers, text);
}

/// Reads a text file of numbers, in which # begins a comment; returns whether there is one.
bool PairContact::read_numbers(const std::string &name, FormNumbers &numbers) const
{
  constexpr int WRONG = -2;
  int n = -1;
  std::string wrong;
  if (comm->me == 0 && !LAMMPS_NS::utils::is_double(name)) {
    std::ifstream file(name);
    if (file.good()) n = 0;
    std::string line, word;
    while (std::getline(file, line)) {
      std::istringstream words(line.substr(0, line.find('#')));
      while (words >> word) {
        if (!LAMMPS_NS::utils::is_double(word)) wrong = word;
        numbers.push_back(std::strtod(word.c_str(), nullptr));
      }
    }
    if (n == 0) n = wrong.empty() ? static_cast<int>(numbers.size()) : WRONG;
  }
  MPI_Bcast(&n, 1, MPI_INT, 0, world);
  if (n == WRONG) {
    error->all(FLERR, "pair_coeff of " + style_name() + " found '" + wrong + "' in " + name +
                          ", expected numbers alone, " + form_rule() + ".");
  }
  if (n < 0) return false;
  numbers.resize(n);
  MPI_Bcast(numbers.data(), n, MPI_DOUBLE, 0, world);
  return true;
}

void PairContact::set_form(int type, const FormNumbers &numbers, const std::string &text)
{
  if (!take_form(type, numbers)) {
    error->all(FLERR, "pair_coeff of " + style_name() + " found " + form_name() + " = " + text +
                          ", expected " + form_rule() + ".");
  }
  form_of[type] = numbers;
}

void PairContact::require_energy(double energy, const std::string &text,
                                 const std::string &where) const
{
  if (energy > 0.0 && std::isfinite(energy)) return;
  error->all(FLERR, where + " found " + energy_name() + " = " + text +
                        ", expected a positive energy: give the contacts a stiffness such as 1.0.");
}

void PairContact::require_arguments(bool is_right, int narg) const
{
  if (is_right) return;
  error->all(FLERR, "pair_coeff of " + style_name() + " found " + std::to_string(narg) +
                        " arguments, expected " + coeff_rule() + ".");
}

void PairContact::require_shape(int i, const Vec<3> &semi_axes) const
{
  if (is_valid_shape(semi_axes, atom->type[i])) return;
  stop_at_shape(semi_axes, "atom " + std::to_string(atom->tag[i]));
}

void PairContact::stop_at_shape(const Vec<3> &semi_axes, const std::string &which) const
{
  const std::string found = style_name() + " found " + which;
  const Vec<3> diameters = 2.0 * semi_axes;
  if (dot(diameters, diameters) == 0.0) {
    refuse(lmp, FLERR,
           "pair_style " + found +
               " without a shape, expected an ellipsoid: list it in the data file's Ellipsoids "
               "section or use 'set atom ... shape'.");
  }
  refuse(lmp, FLERR,
         found + " with diameters " + shown(diameters[0]) + " " + shown(diameters[1]) + " " +
             shown(diameters[2]) + ", expected that " + shape_rule() + ": correct its shape.");
}

/// Under 'atom_style ellipsoid superellipsoid' each atom has exponents as well, of which n1 does
/// not count in 2D.
void PairContact::require_exponents(int i) const
{
  const auto its = particles.exponents(i);
  if (!its) return;
  const int type = atom->type[i];
  const std::array<double, 2> expected = exponents(type);
  if ((*its)[1] == expected[1] && (domain->dimension == 2 || (*its)[0] == expected[0])) return;
  const auto pair = [](const std::array<double, 2> &n) { return shown(n[0]) + " " + shown(n[1]); };
  refuse(lmp, FLERR,
         "pair_style " + style_name() + " found atom " + std::to_string(atom->tag[i]) +
             " with the exponents " + pair(*its) + ", expected " + pair(expected) +
             " of its type " + std::to_string(type) + ": give both the same, by 'set type " +
             std::to_string(type) + " block " + pair(expected) +
             "' or by pair_coeff, or use 'atom_style ellipsoid' alone.");
}

/// Shapes are read at the start of a run, numbers of types with them.
void PairContact::require_lasting_types() const
{
  const bool is_mixture =
      std::any_of(form_of.begin() + 1, form_of.end(), [&](const auto &f) { return f != form(1); });
  for (const LAMMPS_NS::Fix *const fix : compat::fixes(modify)) {
    if (!is_mixture || std::string(fix->style) != "atom/swap") continue;
    error->all(FLERR, "pair_style " + style_name() +
                          " found fix atom/swap, which changes types between evaluations, "
                          "expected the same " +
                          form_name() + " for all types: give it with 'pair_coeff * * " +
                          energy_name() + " " + form_name() + "'.");
  }
}

/// Finds the largest particle of each type, and whether any particle can rotate. Sizes are per
/// particle, so that cutoffs follow from the particles themselves, never from an input that could
/// be too small. If LAMMPS has not yet assigned types to this style, as in a hybrid pair style, all
/// particles with a valid shape are measured.
void PairContact::measure_particles()
{
  std::vector<double> mine(atom->ntypes + 1, 0.0);
  int found[3] = {0, 0, 0};  // particles that can rotate, round ones, ellipsoids
  for (int i = 0; i < atom->nlocal; ++i) {
    const int type = atom->type[i];
    const Vec<3> semi_axes = particles.semi_axes(i);
    if (handles(i)) {
      require_shape(i, semi_axes);
      require_exponents(i);
    } else if (!is_valid_shape(semi_axes, type)) {
      continue;
    }
    mine[type] = std::max(mine[type], bounding_radius(semi_axes, type));
    const Shortcut its = shortcut(semi_axes, type);
    found[0] |= disabled.rotation || turns(semi_axes, type);
    found[1] |= its == Shortcut::ROUND;
    found[2] |= its == Shortcut::ELLIPSOIDS;
  }
  largest_radius.resize(mine.size());
  MPI_Allreduce(mine.data(), largest_radius.data(), static_cast<int>(mine.size()), MPI_DOUBLE,
                MPI_MAX, world);
  int anywhere[3];
  MPI_Allreduce(found, anywhere, 3, MPI_INT, MPI_MAX, world);
  any_turns = anywhere[0];
  any_round = anywhere[1];
  any_ellipsoids = anywhere[2];
}

void PairContact::init_style()
{
  require_decimal_point(lmp, "pair_style " + style_name());
  if (mix_flag == SIXTHPOWER) {
    error->all(FLERR, "pair_style " + style_name() +
                          " found 'pair_modify mix sixthpower', expected geometric or arithmetic, "
                          "which both give the geometric mean of energies: leave it out.");
  }
  particles.find_ellipsoids("pair_style " + style_name());
  require_lasting_types();
  choose_instructions();
  is_ours.assign(atom->ntypes + 1, force->pair == this);  // in a hybrid style init_one sets them
  measure_particles();
  require_orientations_of_rerun();
  if (update->whichflag == 2) require_held_in_minimisation();
  compat::request_list(neighbor, this, instance_me);
  if (update->whichflag == 2 && any_turns) request_minimiser();
}

void PairContact::choose_instructions()
{
  try {
    instructions = required_instruction_set();
  } catch (const std::invalid_argument &wrong) {
    error->all(FLERR, "pair_style " + style_name() + " " + wrong.what());
  }
}

/// LAMMPS reads only positions from a dump. Of all commands that evaluate forces, only `rerun`
/// starts at another step than the present one or has an unreachable last step.
void PairContact::require_orientations_of_rerun() const
{
  const bigint first = update->firststep, last = update->laststep;
  const bool is_run = first == update->ntimestep && last == first + update->nsteps;
  const bool is_unset = first == 0 && last == 0;
  if (!any_turns || update->whichflag != 1 || is_run || is_unset) return;
  error->all(
      FLERR,
      std::string("rerun reads no orientations from a dump, expected particles that cannot rotate: "
                  "read its frames with jamshape.load, or use data or restart files."));
}

/// Rejects fixes that hold particles in dynamics but that LAMMPS ignores in a minimisation.
void PairContact::require_held_in_minimisation() const
{
  for (LAMMPS_NS::Fix *const fix : compat::fixes(modify)) {
    const bool holds = begins_with(fix->style, "freeze") || begins_with(fix->style, "rigid");
    if (!holds || fix->setmask() & LAMMPS_NS::FixConst::MIN_POST_FORCE) continue;
    error->all(FLERR, std::string("minimize found fix ") + fix->id + " of style " + fix->style +
                          ", which LAMMPS ignores in minimisations: hold its particles with 'fix "
                          "ID group setforce 0 0 0' and use 'unfix " +
                          fix->id + "'.");
  }
}

/// Two styles that can rotate the same particles would each keep rotations of their own.
void PairContact::require_only_one_turns() const
{
  if (force->pair == this) return;
  int n_ours = 0;
  LAMMPS_NS::Pair *last = nullptr;  // the only match has every number
  for (int n = 1; auto *const style = force->pair_match("/harmonic", 0, n); ++n) {
    if (style == last) break;
    n_ours += dynamic_cast<PairContact *>(style) != nullptr;
    last = style;
  }
  if (n_ours < 2) return;
  error->all(
      FLERR,
      std::string("minimize found several of jamshape's pair styles in a hybrid one, expected one "
                  "that rotates particles: use one of them."));
}

void PairContact::request_minimiser()
{
  require_only_one_turns();
  const std::string style = update->minimize_style;
  if (style != "cg" && style != "sd") {
    error->all(FLERR, "min_style " + style +
                          " cannot rotate particles: use 'min_style cg' or 'min_style "
                          "sd', which relax positions and orientations together.");
  }
  const double max_move = 0.1;  // as min_modify dmax: rotations are lengths here too
  update->minimize->request(this, rotations(), max_move);
}

double PairContact::init_one(int i, int j)
{
  if (!setflag[i][j]) {
    if (!setflag[i][i] || !setflag[j][j])
      error->all(FLERR, std::string("All pair coeffs are not set"));
    k_e[i][j] = std::sqrt(k_e[i][i] * k_e[j][j]);
  }
  // A fix such as adapt may have changed the coefficient.
  require_energy(k_e[i][j], shown(k_e[i][j]), "pair_style " + style_name());
  k_e[j][i] = k_e[i][j];
  is_ours[i] = is_ours[j] = true;
  return largest_radius[i] + largest_radius[j];
}

void PairContact::setup()
{
  is_new_run = true;
  const double needed = largest_reach() + neighbor->skin;
  // In a tilted box LAMMPS expresses cutoffs as fractions of the distance between its faces.
  const double *const h = domain->h_inv;  // xx, yy, zz, yz, xz, xy
  const double inverse[3] = {std::hypot(h[0], h[5], h[4]), std::hypot(h[1], h[3]), h[2]};
  for (int k = 0; k < domain->dimension; ++k) {
    const double cutoff = comm->cutghost[k] / (domain->triclinic ? inverse[k] : 1.0);
    if (comm->mode == LAMMPS_NS::Comm::SINGLE && cutoff < (1.0 - ROUNDING) * needed) {
      error->all(FLERR, "pair_style " + style_name() + " found a ghost cutoff of " + shown(cutoff) +
                            ", expected at least " + shown(needed) +
                            ": raise it with 'comm_modify cutoff' so that no contact is missed.");
    }
  }
}

double PairContact::largest_energy() const
{
  double largest = 0.0;
  for (int i = 1; i <= atom->ntypes; ++i) {
    for (int j = i; j <= atom->ntypes; ++j) {
      if (setflag[i][j]) largest = std::max(largest, k_e[i][j]);
    }
  }
  return largest;
}

double PairContact::largest_reach() const
{
  double largest = 0.0;
  for (std::size_t type = 1; type < largest_radius.size(); ++type) {
    if (is_ours[type]) largest = std::max(largest, largest_radius[type]);
  }
  return 2.0 * largest;
}

/* ----------------------------------------------------------------------
   work that the present particles do not need
------------------------------------------------------------------------- */

bool PairContact::begins_shortcuts(const std::string &word)
{
  return word == "disable_shortcuts" || word == "general";
}

void PairContact::read_disabled_shortcuts(int narg, char **arg)
{
  disabled = DisabledShortcuts();
  if (narg == 0) return;
  bool is_known = begins_shortcuts(arg[0]) && narg > 1;
  for (int k = 1; k < narg; ++k) {
    const std::string what = arg[k];
    disabled.rotation |= what == "rotation";
    disabled.pairs |= what == "pairs";
    disabled.contact |= what == "contact";
    is_known = is_known && (what == "rotation" || what == "pairs" || what == "contact");
  }
  if (!is_known) {
    error->all(FLERR, "pair_style " + style_name() + " found '" + joined(narg, arg) +
                          "', expected 'disable_shortcuts' and any of rotation, pairs, contact: "
                          "use it only for tests and timings.");
  }
  if (std::string(arg[0]) == "general" && comm->me == 0) {
    error->warning(FLERR, "The keyword 'general' of pair_style " + style_name() +
                              " is called 'disable_shortcuts' now; the old name goes with the next "
                              "release.");
  }
}

std::vector<std::string> PairContact::spared() const
{
  const bool is_plane = domain->dimension == 2;
  std::vector<std::string> found{"energy and virial of steps without output"};
  if (is_plane) found.emplace_back("the third dimension");
  if (!any_turns) found.emplace_back("rotations and torques");
  if (any_round && !disabled.contact) {
    found.emplace_back(is_plane ? "the contact search for discs"
                                : "the contact search for spheres");
  }
  if (any_ellipsoids && !disabled.contact) {
    found.emplace_back(is_plane ? "the general contact search for ellipses"
                                : "the general contact search for ellipsoids");
  }
  return found;
}

void PairContact::report_left_out(double listed, double close)
{
  if (!is_new_run) return;
  is_new_run = false;
  const double mine[2] = {listed, close};
  double all[2];
  MPI_Allreduce(mine, all, 2, MPI_DOUBLE, MPI_SUM, world);
  std::string text;
  for (const std::string &what : spared()) text += (text.empty() ? "" : ", ") + what;
  std::string numbers;
  if (all[0] > all[1]) {
    const double percent = std::round(100.0 * (1.0 - all[1] / all[0]));
    numbers = ", " + std::to_string(static_cast<int>(percent)) + " % of the listed pairs";
  }
  said = text + numbers;
  if (comm->me == 0 && text != told) {
    LAMMPS_NS::utils::logmesg(lmp, "pair_style " + style_name() +
                                       ": skipped, because this run does not need it: " + said +
                                       "\n");
  }
  told = text;
}

/* ---------------------------------------------------------------------- */

void PairContact::require_same_bound(int i, const Vec<3> &semi_axes) const
{
  const int type = atom->type[i];
  if (bounding_radius(semi_axes, type) <= largest_radius[type]) return;
  refuse(lmp, FLERR,
         "pair_style " + style_name() + " found atom " + std::to_string(atom->tag[i]) +
             " larger than at the start of the run, so the ghost cutoff is too short: "
             "do not use 'pre no' in the run after changing shapes.");
}

void PairContact::stop_at_unexpected_turns(int i) const
{
  refuse(
      lmp, FLERR,
      "pair_style " + style_name() + " found atom " + std::to_string(atom->tag[i]) +
          " with a shape that can rotate, although none could at the start of the run: set shapes "
          "before it, and do not use 'pre no' in the run after changing them.");
}

double PairContact::special_weight(int i, int j, int which) const
{
  const double weight = force->special_lj[which];
  if (weight == 0.0 || weight == 1.0) return weight;
  refuse(lmp, FLERR,
         "pair_style " + style_name() + " found special_bonds with a factor of " + shown(weight) +
             " for bonded atoms " + std::to_string(atom->tag[i]) + " and " +
             std::to_string(atom->tag[j]) +
             ", expected 0 or 1: such a pair is in contact like any other, or not at all.");
}

/// Contacts of a particle without a finite position would be dropped silently.
void PairContact::require_numbers(int n) const
{
  for (int i = 0; i < n; ++i) {
    if (!handles(i)) continue;
    const double *const x = atom->x[i];
    const Quaternion q = particles.orientation(i);
    if (std::isfinite(x[0] + x[1] + x[2] + q.w + q.i + q.j + q.k)) continue;
    refuse(lmp, FLERR,
           "pair_style " + style_name() + " found atom " + std::to_string(atom->tag[i]) + " at " +
               shown(x[0]) + " " + shown(x[1]) + " " + shown(x[2]) + " with quaternion " +
               shown(q.w) + " " + shown(q.i) + " " + shown(q.j) + " " + shown(q.k) +
               ", expected finite numbers: use a smaller timestep, or correct its "
               "start.");
  }
}

void PairContact::require_in_plane(int n) const
{
  for (int i = 0; i < n; ++i) {
    if (!handles(i)) continue;
    const Quaternion q = particles.orientation(i);
    if (!(2.0 * std::hypot(q.i, q.j) <= MOST_TILT)) {
      refuse(lmp, FLERR,
             "pair_style " + style_name() + " found atom " + std::to_string(atom->tag[i]) +
                 " rotated out of the plane, expected a quaternion (w, 0, 0, k) in dimension "
                 "2: rotate it about z only.");
    }
  }
}

void PairContact::stop_at_crossing(int i, int j)
{
  refuse(lmp, FLERR,
         "pair_style " + style_name() + " found atoms " + std::to_string(atom->tag[i]) + " and " +
             std::to_string(atom->tag[j]) + " with " + without_force() +
             ", where no contact force exists: start from a state without overlap, or use a "
             "smaller timestep.");
}

void PairContact::stop_at_unconverged(int i, int j)
{
  refuse(lmp, FLERR,
         "pair_style " + style_name() + " found no converged contact of atoms " +
             std::to_string(atom->tag[i]) + " and " + std::to_string(atom->tag[j]) +
             ": use semi-axes within a factor 100 and exponents from 0.55 to 10.");
}

bool PairContact::is_mine(int i, int j) const
{
  if (force->newton_pair || j < atom->nlocal) return true;
  if (atom->tag[i] != atom->tag[j]) return atom->tag[i] < atom->tag[j];
  // A particle and its own image: the list has both directions of the image.
  const double *xi = atom->x[i], *xj = atom->x[j];
  for (int k = 0; k < 3; ++k) {
    if (xi[k] != xj[k]) return xi[k] < xj[k];
  }
  return false;
}

std::vector<LocalBond> PairContact::reported_bonds()
{
  std::vector<LocalBond> reported;
  for_each_bond([&](const LocalBond &b) {
    if (!is_mine(b.i, b.j)) return;
    if (atom->tag[b.i] <= atom->tag[b.j]) {
      reported.push_back(b);
    } else {
      const Vec<3> zero{};  // 0 - 0 is 0; -0 would be written as such
      reported.push_back({b.j,
                          b.i,
                          b.kind,
                          b.number,
                          zero - b.normal,
                          zero - b.force,
                          b.arm_j,
                          b.arm_i,
                          b.distance,
                          b.reach,
                          b.energy,
                          b.stiffness,
                          b.on_side_j,
                          b.on_side_i,
                          {b.on_faces.j, b.on_faces.i}});
    }
  });
  return reported;
}

/* ---------------------------------------------------------------------- */

/// Numbers of types, for shapes that have them: first how many, negative. (Version 0.1 had an
/// exponent of each type alone, which is positive.)
void PairContact::write_forms(FILE *fp) const
{
  for (int type = 1; type <= atom->ntypes; ++type) {
    const double size = -static_cast<double>(form(type).size());
    fwrite(&size, sizeof(double), 1, fp);
    fwrite(form(type).data(), sizeof(double), form(type).size(), fp);
  }
}

void PairContact::read_forms(FILE *fp)
{
  const auto read = [&](double *to, std::size_t n) {
    if (comm->me == 0) LAMMPS_NS::utils::sfread(FLERR, to, sizeof(double), n, fp, nullptr, error);
    MPI_Bcast(to, static_cast<int>(n), MPI_DOUBLE, 0, world);
  };
  for (int type = 1; type <= atom->ntypes; ++type) {
    double size;
    read(&size, 1);
    FormNumbers numbers(size > 0.0 ? 1 : static_cast<std::size_t>(-size), size);
    if (!(size > 0.0)) read(numbers.data(), numbers.size());
    set_form(type, numbers, "the numbers of a restart file");
  }
}

/// The numbers of a type as text, none if it is longer.
std::string PairContact::more_coefficients(int type, std::size_t longest) const
{
  std::string text;
  for (const double number : form(type)) text += " " + exactly(number);
  return text.size() < longest ? text : "";
}

void PairContact::write_restart_settings(FILE *fp)
{
  if (power == HARMONIC) return;
  fwrite(&LAW_FOLLOWS, sizeof(int), 1, fp);
  fwrite(&power, sizeof(double), 1, fp);
}

void PairContact::read_restart_settings(FILE *fp)
{
  power = HARMONIC;
  if (comm->me == 0) {
    int next = 0;
    const long here = std::ftell(fp);
    LAMMPS_NS::utils::sfread(FLERR, &next, sizeof(int), 1, fp, nullptr, error);
    if (next == LAW_FOLLOWS) {
      LAMMPS_NS::utils::sfread(FLERR, &power, sizeof(double), 1, fp, nullptr, error);
    } else {
      std::fseek(fp, here, SEEK_SET);
    }
  }
  MPI_Bcast(&power, 1, MPI_DOUBLE, 0, world);
}

void PairContact::write_restart(FILE *fp)
{
  write_restart_settings(fp);
  for (int i = 1; i <= atom->ntypes; ++i) {
    for (int j = i; j <= atom->ntypes; ++j) {
      fwrite(&setflag[i][j], sizeof(int), 1, fp);
      fwrite(&k_e[i][j], sizeof(double), 1, fp);
    }
  }
  if (!form_name().empty()) write_forms(fp);
}

void PairContact::read_restart(FILE *fp)
{
  read_restart_settings(fp);
  allocate();
  for (int i = 1; i <= atom->ntypes; ++i) {
    for (int j = i; j <= atom->ntypes; ++j) {
      if (comm->me == 0) {
        LAMMPS_NS::utils::sfread(FLERR, &setflag[i][j], sizeof(int), 1, fp, nullptr, error);
        LAMMPS_NS::utils::sfread(FLERR, &k_e[i][j], sizeof(double), 1, fp, nullptr, error);
      }
      MPI_Bcast(&setflag[i][j], 1, MPI_INT, 0, world);
      MPI_Bcast(&k_e[i][j], 1, MPI_DOUBLE, 0, world);
      k_e[j][i] = k_e[i][j];
    }
  }
  if (!form_name().empty()) read_forms(fp);
}

void PairContact::write_data(FILE *fp)
{
  for (int i = 1; i <= atom->ntypes; ++i) {
    const std::string more = more_coefficients(i, LONGEST_COEFFICIENTS);
    std::fprintf(fp, "%d %s%s\n", i, exactly(k_e[i][i]).c_str(), more.c_str());
  }
}

void PairContact::write_data_all(FILE *fp) { write_pairs(fp, LONGEST_COEFFICIENTS); }

void PairContact::write_pairs(FILE *fp, std::size_t longest) const
{
  for (int i = 1; i <= atom->ntypes; ++i) {
    for (int j = i; j <= atom->ntypes; ++j) {
      const std::string more = i == j ? more_coefficients(i, longest) : "";
      std::fprintf(fp, "%d %d %s%s\n", i, j, exactly(k_e[i][j]).c_str(), more.c_str());
    }
  }
}

void *PairContact::extract(const char *name, int &dimension)
{
  dimension = 2;
  return energy_name() == name ? k_e : nullptr;
}

double PairContact::memory_usage()
{
  return Pair::memory_usage() +
         static_cast<double>((x_extra.capacity() + f_extra.capacity() + gyration.capacity()) *
                             sizeof(double));
}

/* ----------------------------------------------------------------------
   minimisation: the extra coordinates of a particle are its rotation vector (its angle in 2D) times
   a length, a function of its orientation alone, so that they survive migration between ranks
------------------------------------------------------------------------- */

int PairContact::rotations() const { return domain->dimension == 2 ? 1 : 3; }

Upper PairContact::cell() const
{
  const double *const edge = domain->prd;
  const Vec<3> edges{{edge[0], edge[1], edge[2]}};
  if (!domain->triclinic) return {edges, 0.0, 0.0, 0.0};
  return {edges, domain->xy, domain->xz, domain->yz};
}

void PairContact::min_xf_pointers(int, double **x, double **f)
{
  const std::size_t n = static_cast<std::size_t>(atom->nlocal);
  x_extra.resize(std::max<std::size_t>(1, n * rotations()));
  f_extra.resize(x_extra.size());
  gyration.assign(n, 1.0);
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!handles(i)) continue;
    const Vec<3> moment = drag(particles.semi_axes(i), atom->type[i]).moment;
    gyration[i] = std::sqrt(std::max({moment[0], moment[1], moment[2]}));
  }
  *x = x_extra.data();
  *f = f_extra.data();
}

void PairContact::min_xf_get(int)
{
  double *x = nullptr, *f = nullptr;
  min_xf_pointers(0, &x, &f);
  find_held();
  const int nlocal = atom->nlocal;
  const double none[3] = {};
  for (int i = 0; i < nlocal; ++i) {
    const Quaternion q = particles.orientation(i);
    const double *torque = is_held[i] ? none : atom->torque[i];
    if (rotations() == 1) {
      x[i] = gyration[i] * 2.0 * std::atan2(q.k, q.w);
      f[i] = torque[2] / gyration[i];
      continue;
    }
    const Vec<3> v = rotation_vector(q);
    const Vec<3> gradient = torque_on_rotation_vector(v, {{torque[0], torque[1], torque[2]}});
    for (int k = 0; k < 3; ++k) {
      x[3 * i + k] = gyration[i] * v[k];
      f[3 * i + k] = gradient[k] / gyration[i];
    }
  }
}

/// A particle is held in a minimisation if fix setforce, whose arguments no header exposes, sets
/// every component of its force to zero: the fix is called with unit forces to find out. Particles
/// handled by other styles of a hybrid one are left alone.
void PairContact::find_held()
{
  const int nlocal = atom->nlocal, d = domain->dimension;
  is_held.assign(nlocal, false);
  for (int i = 0; i < nlocal; ++i) is_held[i] = !handles(i);
  std::vector<double> kept;
  double **const f = atom->f, *const all = nlocal > 0 ? f[0] : nullptr;
  for (LAMMPS_NS::Fix *const fix : compat::fixes(modify)) {
    if (!begins_with(fix->style, "setforce")) continue;
    if (!(fix->setmask() & LAMMPS_NS::FixConst::MIN_POST_FORCE)) continue;
    kept.assign(all, all + 3 * nlocal);
    std::fill_n(all, 3 * nlocal, 1.0);
    fix->min_post_force(0);  // on all ranks: it may evaluate variables
    for (int i = 0; i < nlocal; ++i) {
      is_held[i] |= std::all_of(f[i], f[i] + d, [](double component) { return component == 0.0; });
    }
    std::copy(kept.begin(), kept.end(), all);
  }
}

void PairContact::min_x_set(int)
{
  const int nlocal = atom->nlocal;
  for (int i = 0; i < nlocal; ++i) {
    if (is_held[i]) continue;
    const double scale = 1.0 / gyration[i];
    const Quaternion q =
        rotations() == 1
            ? rotation_by(Vec<1>{{scale * x_extra[i]}})
            : rotation_by(scale * Vec<3>{{x_extra[3 * i], x_extra[3 * i + 1], x_extra[3 * i + 2]}});
    particles.set_orientation(i, q);
  }
}

}  // namespace jamshape
