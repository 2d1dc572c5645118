#include "fix_overdamped_affine.h"

#include "atom.h"
#include "comm.h"
#include "compat.h"
#include "compute.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "neighbor.h"
#include "text.hpp"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

namespace jamshape {

using LAMMPS_NS::bigint;

namespace {

/// The fix warns if the time step exceeds this fraction of the stability limit.
constexpr double NEAR_LIMIT = 0.9;

/// Largest strain between estimates of the limit, as contacts may form meanwhile.
constexpr double STRAIN_BETWEEN_CHECKS = 0.005;

/// Largest strain of the box in one step of LAMMPS, so that output can resolve the motion.
constexpr double LARGEST_STRAIN = 1.0;

constexpr int N_OF_SUBSTEPS = 8, N_OF_FLOW = 4, N_OF_CONTROL = 2;

constexpr const char *SYNTAX =
    "'drag k_d [compress kappa] [shear gdot] [pure edot] [gradient ...] [pressure iso START STOP] "
    "[stress ab P] [tbox T] [volume free|constant] [flip F] [integrator NAME] [tolerance T] "
    "[stages MAX] [reference center|corner] [check N]'.";

/// Global data of a restart file. The first number identifies the format.
constexpr std::uint64_t SAVED_AS = 0x6a616d7368617003, WITHOUT_TIME = SAVED_AS - 1;

struct Saved {
  std::uint64_t format;
  AffineBox::State box;
  StepState steps;
  double mean_turn;
  double time;  // absent from files of the format WITHOUT_TIME
};

/// Prefixes of the names of fixes that act on velocities or through them; EVENT/ belongs to
/// accelerated dynamics at a temperature, as by `tad`.
constexpr const char *OF_VELOCITIES[] = {
    "langevin", "viscous", "viscosity", "temp/", "heat", "ehex", "momentum", "thermal/",
    "ffl",      "gle",     "gld",       "ttm",   "srd",  "nvk",  "pimd",     "EVENT/"};

bool begins_with(const std::string &text, const std::string &with)
{
  return text.compare(0, with.size(), with) == 0;
}

}  // namespace

/// Settings from the arguments of the command, except the interval of checks.
struct FixOverdampedAffine::Command {
  double k_d;
  Upper gradient{};
  std::string method = "heun";
  IntegratorOptions of_method{};
  AffineBox::Reference reference = AffineBox::Reference::CENTER;
  bool holds_volume = false;
};

FixOverdampedAffine::FixOverdampedAffine(LAMMPS_NS::LAMMPS *lmp, int narg, char **arg) :
    Fix(lmp, narg, arg), check_every(1000), next_check(0), largest_rate(0.0), largest_tilt(0.5),
    holds_volume(false), warned(false), was_told(false), running(false), inside_step(false),
    has_begun(false), next_look(0)
{
  make_parts(read(narg, arg));
  tell_what_this_is();
  grow_arrays(atom->nmax);
  atom->add_callback(LAMMPS_NS::Atom::GROW);
  atom->add_callback(LAMMPS_NS::Atom::RESTART);
  for (int i = 0; i < atom->nlocal; ++i) set_arrays(i);
}

void FixOverdampedAffine::fail(const std::string &found_and_expected) const
{
  error->all(FLERR, "fix overdamped/affine found " + found_and_expected);
}

FixOverdampedAffine::Command FixOverdampedAffine::read(int narg, char **arg)
{
  if (igroup != 0) {
    fail("a group other than all, expected 'all', since the whole box moves: hold particles at "
         "rest in the host by 'fix setforce 0 0 0' or 'fix freeze' on their group.");
  }
  if (narg < 5 || std::strcmp(arg[3], "drag")) {
    fail(std::string("wrong arguments, expected ") + SYNTAX);
  }
  Command command;
  command.k_d = number(arg[4]);
  if (!(command.k_d > 0.0) || !std::isfinite(command.k_d)) {
    fail(std::string("drag ") + arg[4] + ", expected a positive number.");
  }
  control = std::make_unique<BoxControl>(lmp, command.k_d);
  for (int k = 5; k < narg;) {
    int taken = read_flow(k, narg, arg, command);
    if (taken == 0) taken = read_control(k, narg, arg);
    if (taken == 0 && k + 1 >= narg) fail(std::string("'") + arg[k] + "', expected " + SYNTAX);
    if (taken == 0) read_option(arg[k], arg[k + 1], command);
    k += taken > 0 ? taken : 2;
  }
  if (command.holds_volume) require_no_trace(command.gradient);
  return command;
}

/// Reads a keyword of the control of stress, as read_flow.
int FixOverdampedAffine::read_control(int k, int narg, char **arg)
{
  try {
    return control->read(k, narg, arg);
  } catch (const std::invalid_argument &problem) {
    fail(problem.what());
  }
}

void FixOverdampedAffine::require_no_trace(const Upper &gradient) const
{
  const Vec<3> &d = gradient.diagonal;
  const double trace = d[0] + d[1] + d[2];
  const double largest = std::max({std::fabs(d[0]), std::fabs(d[1]), std::fabs(d[2])});
  if (std::fabs(trace) > 8.0 * std::numeric_limits<double>::epsilon() * largest) {
    fail("volume constant and a velocity gradient whose trace is " + shown(trace) +
         ", expected a trace of 0.");
  }
}

double FixOverdampedAffine::number(const char *text) const
{
  return LAMMPS_NS::utils::numeric(FLERR, text, false, lmp);
}

/// Reads a keyword of the flow; returns the number of arguments used, 0 for any other keyword.
int FixOverdampedAffine::read_flow(int k, int narg, char **arg, Command &to) const
{
  const std::string keyword = arg[k];
  const int d = domain->dimension;
  if (keyword == "gradient") {
    if (k + d * d >= narg) {
      fail("gradient with " + std::to_string(narg - k - 1) + " numbers, expected " +
           std::to_string(d * d) + ", row by row.");
    }
    to.gradient = to.gradient + read_gradient(arg + k + 1);
    return 1 + d * d;
  }
  if (keyword != "compress" && keyword != "shear" && keyword != "pure") return 0;
  if (k + 1 >= narg) fail(keyword + " without a number, expected a rate.");
  const double rate = number(arg[k + 1]);
  if (!std::isfinite(rate)) fail(keyword + " " + arg[k + 1] + ", expected a finite rate.");
  Upper added{};
  if (keyword == "compress") {
    for (int j = 0; j < d; ++j) added.diagonal[j] = -rate;
  } else if (keyword == "shear") {
    added.xy = rate;
  } else {
    added.diagonal = {{rate, -rate, 0.0}};
  }
  to.gradient = to.gradient + added;
  return 2;
}

Upper FixOverdampedAffine::read_gradient(char **arg) const
{
  const int d = domain->dimension;
  double entry[3][3] = {};
  for (int row = 0; row < d; ++row) {
    for (int column = 0; column < d; ++column) {
      const char *const text = arg[d * row + column];
      entry[row][column] = number(text);
      if (!std::isfinite(entry[row][column])) {
        fail(std::string("gradient with ") + text + ", expected finite rates.");
      }
      if (row > column && entry[row][column] != 0.0) {
        fail(std::string("gradient with ") + text +
             " below the diagonal, expected 0: rotate the axes so that the flow keeps the first "
             "cell "
             "vector along x and the second one in the plane of x and y.");
      }
    }
  }
  return {{{entry[0][0], entry[1][1], entry[2][2]}}, entry[0][1], entry[0][2], entry[1][2]};
}

void FixOverdampedAffine::read_option(const std::string &keyword, const char *text, Command &to)
{
  const std::string value = text;
  if (keyword == "integrator") {
    to.method = value;
  } else if (keyword == "tolerance") {
    to.of_method.tolerance = number(text);
  } else if (keyword == "stages") {
    to.of_method.stages = LAMMPS_NS::utils::inumeric(FLERR, text, false, lmp);
  } else if (keyword == "reference" && (value == "center" || value == "corner")) {
    to.reference = value == "center" ? AffineBox::Reference::CENTER : AffineBox::Reference::CORNER;
  } else if (keyword == "volume" && (value == "constant" || value == "free")) {
    to.holds_volume = value == "constant";
  } else if (keyword == "flip") {
    largest_tilt = number(text);
    if (!(largest_tilt >= 0.5 && std::isfinite(largest_tilt))) {
      fail("flip " + value + ", expected a fraction of an edge, at least 0.5.");
    }
  } else if (keyword == "check") {
    check_every = LAMMPS_NS::utils::bnumeric(FLERR, text, false, lmp);
    if (check_every < 0) fail("check " + value + ", expected a number of steps, or 0 for never.");
  } else {
    fail("'" + keyword + " " + value + "', expected " + SYNTAX);
  }
}

void FixOverdampedAffine::make_parts(const Command &of)
{
  require_cell(of.gradient);
  holds_volume = of.holds_volume;
  box = std::make_unique<AffineBox>(lmp, of.gradient, of.reference);
  try {
    integrator = make_integrator(of.method, *box, of.of_method);
  } catch (const std::invalid_argument &problem) {
    fail(problem.what());
  }
  if (!integrator) {
    fail("integrator " + of.method + ", expected one of: " + integrator_names() + ".");
  }
  flow = std::make_unique<OverdampedFlow>(lmp, of.k_d, *box, this, integrator->n_registers());
  if (integrator->state()) flow->allow_retries();
  make_control(of);
}

/// Lets the box yield if a component of the stress is controlled.
void FixOverdampedAffine::make_control(const Command &of)
{
  try {
    control->require_complete(of.holds_volume);
    control->drive(of.gradient);
  } catch (const std::invalid_argument &problem) {
    fail(problem.what());
  }
  if (!control->is_on()) {
    control.reset();
    return;
  }
  if (control->shears() && !domain->triclinic) {
    fail("a box without tilt, expected one that shear can tilt: use 'change_box all triclinic'.");
  }
  control->yield(*box);
  flow->yield_by(control.get());
  // LAMMPS sums the virial on the steps that a compute of the pressure asks for.
  modify->add_compute(std::string(id) + "_stress all pressure NULL virial");
}

void FixOverdampedAffine::need_virial(bigint step)
{
  const std::string name = std::string(id) + "_stress";
  for (LAMMPS_NS::Compute *const compute : compat::computes(modify)) {
    if (compute->id == name) return compute->addstep(step);
  }
  flow->stop("found no compute " + name +
             ", expected the one that the fix made: leave out its 'uncompute'.");
}

/// Sets the rates of the box to those of the stress and the targets at LAMMPS's own forces.
void FixOverdampedAffine::follow_stress(bigint step)
{
  control->aim();
  need_virial(update->ntimestep + 1);
  if (update->vflag_global == step) {
    control->follow();
  } else {
    flow->evaluate_forces();
  }
}

/// Sets the members that LAMMPS reads.
void FixOverdampedAffine::tell_what_this_is()
{
  time_integrate = 1;
  time_depend = 1;
  no_change_box = 1;
  box_change = BOX_CHANGE_X | BOX_CHANGE_Y;
  if (domain->dimension == 3) box_change |= BOX_CHANGE_Z;
  if (domain->triclinic) {
    box_change |= BOX_CHANGE_XY;
    if (domain->dimension == 3) box_change |= BOX_CHANGE_XZ | BOX_CHANGE_YZ;
    force_reneighbor = 1;
    next_reneighbor = -1;
  }
  restart_global = restart_peratom = 1;
  create_attribute = 1;
  maxexchange = flow->width();
  comm_forward = flow->width();
  vector_flag = 1;
  size_vector = 8 + N_OF_SUBSTEPS + N_OF_FLOW + N_OF_CONTROL;
  global_freq = 1;
  extvector = 0;
}

FixOverdampedAffine::~FixOverdampedAffine()
{
  if (copymode) return;
  if (control) modify->delete_compute(std::string(id) + "_stress");
  atom->delete_callback(id, LAMMPS_NS::Atom::GROW);
  atom->delete_callback(id, LAMMPS_NS::Atom::RESTART);
}

int FixOverdampedAffine::setmask()
{
  using namespace LAMMPS_NS::FixConst;
  return INITIAL_INTEGRATE | (control ? FINAL_INTEGRATE : 0) | POST_NEIGHBOR | MIN_POST_NEIGHBOR |
         POST_RUN | (domain->triclinic ? PRE_EXCHANGE : 0);
}

/// Rejects other fixes that move the same particles, and fixes without any effect here.
void FixOverdampedAffine::require_alone() const
{
  const std::string integrate = update->integrate_style ? update->integrate_style : "verlet";
  if (integrate != "verlet") {
    fail("run_style " + integrate +
         ", expected verlet: use 'run_style verlet'; integrators rkc2 and heun/adaptive choose "
         "their own substeps.");
  }
  if (force->kspace || force->bond || force->angle || force->dihedral || force->improper) {
    fail(
        "bonds, angles, dihedrals, impropers or a kspace_style, expected forces of contacts and of "
        "fixes alone: set these styles to none.");
  }
  for (const Fix *const other : compat::fixes(modify)) {
    if (other == this) continue;
    const std::string named = "fix " + std::string(other->style) + " (" + other->id + ")";
    const std::string cure = std::string(": use 'unfix ") + other->id + "'.";
    if (other->time_integrate) {
      fail(named + ", which also moves particles, expected only this fix to move them" + cure);
    }
    for (const char *const style : OF_VELOCITIES) {
      if (!begins_with(other->style, style)) continue;
      fail(named +
           ", which acts on velocities, expected none: the motion has no inertia and no "
           "temperature" +
           cure);
    }
  }
}

/// Replaces the velocity gradient by the sum of those specified.
int FixOverdampedAffine::modify_param(int narg, char **arg)
{
  Command command{};
  int k = 0;
  for (int taken = 1; taken > 0 && k < narg; k += taken) taken = read_flow(k, narg, arg, command);
  if (k == 0) return 0;  // LAMMPS rejects the keyword
  require_cell(command.gradient);
  if (holds_volume) require_no_trace(command.gradient);
  box->change_gradient(command.gradient);
  if (!control) return k;
  try {
    control->drive(command.gradient);
  } catch (const std::invalid_argument &problem) {
    fail(problem.what());
  }
  return k;
}

void FixOverdampedAffine::init()
{
  require_alone();
  for (int k = 0; k < domain->dimension; ++k) {
    if (!domain->periodicity[k]) {
      error->all(
          FLERR,
          std::string(
              "fix overdamped/affine found a box that is not periodic, expected 'boundary p p "
              "p': the whole box moves."));
    }
  }
  // A late rebuild would lose contacts silently.
  if (neighbor->every != 1 || neighbor->delay != 0 || !neighbor->dist_check) {
    if (comm->me == 0) {
      error->warning(
          FLERR,
          std::string("fix overdamped/affine uses 'neigh_modify every 1 delay 0 check yes'"));
    }
    neighbor->every = 1;
    neighbor->delay = 0;
    neighbor->dist_check = 1;
  }
  running = false;
}

/// A shear flow needs a cell that can tilt.
void FixOverdampedAffine::require_cell(const Upper &gradient) const
{
  if (gradient.has_shear() && !domain->triclinic) {
    fail("a box without tilt, expected one that shear can tilt: use 'change_box all triclinic'.");
  }
}

/* ---------------------------------------------------------------------- */

void FixOverdampedAffine::setup_post_neighbor()
{
  begin_run(update->ntimestep);
  tell_what_is_left_out();
  running = update->whichflag == 1;
}

/// Updates everything that may have changed since the last run.
void FixOverdampedAffine::begin_run(bigint step)
{
  if (!box->begin_run(step)) {
    flow->set_mean_turn(0.0);
    if (comm->me == 0) {
      error->warning(FLERR,
                     std::string("fix overdamped/affine found a box other than the one it left, so "
                                 "that its strain restarts at 0"));
    }
  }
  const bool is_known = flow->begin_run();
  if (StepState *const state = integrator->state(); state && !is_known) state->h = 0.0;
  has_begun = true;
  if (update->whichflag != 1) return;
  if (update->nsteps > 0) require_timestep();
  if (flow->stop_particles() && comm->me == 0) {
    error->warning(FLERR,
                   std::string("fix overdamped/affine set velocities to 0: its motion has no "
                               "inertia, but pressure and temperature would include them"));
  }
}

/// Follows, or rejects, changes made at the start of a step without a call to this fix.
void FixOverdampedAffine::take_up(bigint from)
{
  if (!has_begun) begin_run(from);  // 'run N pre no'
  if (!box->is_as_left()) {
    flow->stop("found that something else changed the box in the last step, expected no other fix "
               "that does: use 'unfix', or run that fix before or after the flow.");
  }
  if (box->follow_timestep()) {
    require_timestep();
    next_check = from;
  }
  if (from == next_look) flow->require_untouched();
  if (from == update->firststep) next_look = from + 1;
}

void FixOverdampedAffine::require_timestep() const
{
  // That of a box that yields is judged step by step.
  const double speed = control ? AffineBox::speed_of(control->driven()) : box->speed();
  const double strain = speed * update->dt;
  if (!(update->dt > 0.0)) {
    flow->stop("found timestep " + shown(update->dt) +
               ", expected a positive one: to open the box, give 'compress' a negative rate.");
  }
  if (!integrator->state()) return require_strain(strain);
  if (strain <= LARGEST_STRAIN) return;
  flow->stop("found timestep " + shown(update->dt) + ", a strain of " + shown(strain) +
             ", expected a strain of at most 1 per step: the integrator divides the step.");
}

/// Checks the strain of an undivided step; called before the step, since a box that shrinks to
/// nothing takes the state with it.
void FixOverdampedAffine::require_strain(double strain) const
{
  const double radii = 0.5 * strain / flow->largest_strain();
  if (radii <= 0.5) return;  // also for NaN
  flow->stop(
      "found a strain of " + shown(strain) + " in one step, which pushes a particle " +
      shown(radii) +
      " radii into its neighbour, expected at most half its radius: use a smaller timestep.");
}

/// Writes the pair style's report of skipped work; see PairContact::report_left_out.
void FixOverdampedAffine::tell_what_is_left_out()
{
  if (comm->me != 0 || was_told) return;
  was_told = true;
  std::string text =
      control ? "energy of stages within steps" : "energy and virial of stages within steps";
  if (!integrator->state()) text += ", second derivatives";
  LAMMPS_NS::utils::logmesg(
      lmp, "fix overdamped/affine: skipped, because this run does not need it: " + text + "\n");
}

void FixOverdampedAffine::post_neighbor()
{
  if (!running) return;
  flow->measure_particles();
  if (domain->triclinic) flow->follow_images();
  if (!inside_step) flow->require_untouched();
}

void FixOverdampedAffine::min_post_neighbor() { flow->measure_particles(); }

/// LAMMPS also calls this after minimisations.
void FixOverdampedAffine::post_run()
{
  if (running) flow->require_untouched();
  has_begun = false;
}

void FixOverdampedAffine::setup(int)
{
  if (update->whichflag != 1) return;
  next_check = update->ntimestep;
  if (control) follow_stress(update->ntimestep);
  check_stability(update->ntimestep);
  integrator->begin_run(*flow);
}

void FixOverdampedAffine::initial_integrate(int)
{
  const bigint to = update->ntimestep, from = to - 1;
  take_up(from);
  if (control) {
    follow_stress(from);
    if (!integrator->state()) require_strain(box->speed() * update->dt);
  }
  if (from >= next_check) check_stability(from);
  flow->count_evaluation();  // LAMMPS's own, at the end of the last step
  inside_step = true;
  integrator->step(*flow, to, update->dt);
  inside_step = false;
  box->reach(to);
  ask_for_flip();
}

/// Sets the rate of the box at the end of the step, for output.
void FixOverdampedAffine::final_integrate() { control->follow(); }

/// Atoms change their images with the cell, which is possible only when LAMMPS builds its lists.
void FixOverdampedAffine::ask_for_flip()
{
  const bigint step = update->ntimestep;
  if (domain->triclinic && !box->flip_needed(step, largest_tilt).is_none()) next_reneighbor = step;
}

void FixOverdampedAffine::pre_exchange()
{
  const bigint step = update->ntimestep;
  if (!running || inside_step) return;
  const AffineBox::Flip flip = box->flip_needed(step, largest_tilt);
  if (flip.is_none()) return;
  flow->change_reference(box->flip(flip));
  box->set_box(box->deformation(step));
  domain->image_flip(static_cast<int>(flip.m), static_cast<int>(flip.n), static_cast<int>(flip.p));
  for (int i = 0; i < atom->nlocal; ++i) domain->remap(atom->x[i], atom->image[i]);
  domain->x2lamda(atom->nlocal);
  LAMMPS_NS::Irregular(lmp).migrate_atoms(0, 0, nullptr);
  domain->lamda2x(atom->nlocal);
}

double FixOverdampedAffine::largest_stable_dt() const
{
  const double rate = present_rate();
  return rate > 0.0 ? integrator->stability_interval() / rate : INFINITY;
}

double FixOverdampedAffine::present_rate() const
{
  const StepState *const state = integrator->state();
  return state ? state->rate : largest_rate;
}

void FixOverdampedAffine::check_stability(bigint step)
{
  if (check_every == 0 || update->dt == 0.0 || integrator->state()) return;
  if (step < next_check) return;
  const double strain_a_step = box->speed() * update->dt;
  const double until_strained = std::ceil(STRAIN_BETWEEN_CHECKS / strain_a_step);
  next_check = step + (until_strained < static_cast<double>(check_every)
                           ? static_cast<bigint>(until_strained)
                           : check_every);
  largest_rate = flow->largest_rate_of_bonds();
  if (control) largest_rate += control->largest_rate();
  const double limit = largest_stable_dt();
  if (update->dt <= NEAR_LIMIT * limit) {
    warned = false;
    return;
  }
  const std::string found = "fix overdamped/affine found timestep " + shown(update->dt);
  const std::string largest =
      shown(limit) + " (2 over the largest relaxation rate " + shown(largest_rate) + ")";
  if (update->dt > limit) {
    error->all(FLERR, found + " above the stability limit " + largest + ": use a timestep below " +
                          shown(NEAR_LIMIT * limit) + ".");
  }
  if (!warned && comm->me == 0) {
    error->warning(FLERR, found + " close to the stability limit " + largest +
                              ": a denser state may exceed it.");
  }
  warned = true;
}

double FixOverdampedAffine::compute_vector(int n)
{
  const bigint step = box->reached();
  switch (n) {
    case 0:
      return box->time(step);
    case 1:
      return box->strain(step);
    case 2:
      return present_rate();
    case 3:
      return largest_stable_dt();
    case 4:
      return flow->knows_particles() ? flow->dissipated_power() : NAN;
    case 5:
      return static_cast<double>(flow->n_evaluations());
    case 6:
      return static_cast<double>(flow->n_rebuilds());
    case 7:
      return flow->stage_difference();
    case 16:
      return box->shear_strain(step);
    case 17:
      return box->pure_strain(step);
    case 18:
      return flow->mean_turn();
    case 19:
      return flow->knows_particles() ? flow->power_of_host() : NAN;
    case 20:
      return control ? control->time() : 0.0;
    case 21:
      return control ? control->host_viscosity() : 0.0;
    default:
      return of_substeps(n - 8);
  }
}

double FixOverdampedAffine::of_substeps(int n) const
{
  const StepState *const state = integrator->state();
  if (!state) return 0.0;
  const StepReport report = integrator->report();
  const double values[N_OF_SUBSTEPS] = {static_cast<double>(state->accepted),
                                        static_cast<double>(state->rejected),
                                        static_cast<double>(state->forced),
                                        state->h,
                                        report.shortest,
                                        report.error,
                                        report.stages,
                                        state->touching.overlap};
  return values[n];
}

double FixOverdampedAffine::memory_usage() { return flow->memory_usage(); }

/* ----------------------------------------------------------------------
   restart and migration
------------------------------------------------------------------------- */

void FixOverdampedAffine::write_restart(FILE *fp)
{
  const double mean_turn = flow->mean_turn();
  flow->set_mean_turn(mean_turn);  // rounded as where the file is read
  if (comm->me != 0) return;
  const StepState *const of_steps = integrator->state();
  const Saved saved{SAVED_AS, box->saved_state(), of_steps ? *of_steps : StepState{}, mean_turn,
                    box->saved_time()};
  const int size = sizeof(saved);
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(&saved, size, 1, fp);
}

void FixOverdampedAffine::restart(char *buf)
{
  Saved saved{};
  std::memcpy(&saved.format, buf, sizeof(saved.format));
  if (saved.format != SAVED_AS && saved.format != WITHOUT_TIME) {
    fail("a restart file of another version of jamshape, expected one of this version: "
         "continue with that version, or start from a data file.");
  }
  std::memcpy(&saved, buf, saved.format == SAVED_AS ? sizeof(saved) : offsetof(Saved, time));
  box->restore(saved.box, saved.time);
  if (StepState *const of_steps = integrator->state()) *of_steps = saved.steps;
  flow->set_mean_turn(saved.mean_turn);
}

void FixOverdampedAffine::grow_arrays(int nmax) { flow->grow(nmax); }
void FixOverdampedAffine::copy_arrays(int from, int to, int) { flow->copy(from, to); }
void FixOverdampedAffine::set_arrays(int i) { flow->set(i); }
int FixOverdampedAffine::pack_exchange(int i, double *buf) { return flow->pack(i, buf); }
int FixOverdampedAffine::unpack_exchange(int i, double *buf) { return flow->unpack(i, buf); }

int FixOverdampedAffine::pack_restart(int i, double *buf)
{
  buf[0] = size_restart(i);  // size by which LAMMPS skips
  std::memcpy(buf + 1, flow->coordinates(i), flow->n_coordinates() * sizeof(double));
  return size_restart(i);
}

void FixOverdampedAffine::unpack_restart(int i, int nth)
{
  const double *from = atom->extra[i];
  for (int skip = 0; skip < nth; ++skip) from += static_cast<int>(*from);
  std::memcpy(flow->coordinates(i), from + 1, flow->n_coordinates() * sizeof(double));
}

int FixOverdampedAffine::size_restart(int) { return flow->n_coordinates() + 1; }
int FixOverdampedAffine::maxsize_restart() { return flow->n_coordinates() + 1; }

int FixOverdampedAffine::pack_forward_comm(int n, int *list, double *buf, int, int *)
{
  return flow->pack_direction(n, list, buf);
}

void FixOverdampedAffine::unpack_forward_comm(int n, int first, double *buf)
{
  flow->unpack_direction(n, first, buf);
}

}  // namespace jamshape
