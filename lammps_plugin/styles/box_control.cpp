#include "box_control.h"

#include "atom.h"
#include "comm.h"
#include "compat.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "input.h"
#include "modify.h"
#include "packing/box_times.hpp"
#include "text.hpp"
#include "update.h"
#include "utils.h"
#include "variable.h"

#include <algorithm>
#include <cmath>
#include <mpi.h>
#include <stdexcept>

namespace jamshape {

using LAMMPS_NS::bigint;

namespace {

constexpr const char *NAMES[] = {"xx", "yy", "zz", "xy", "xz", "yz"};

/// Packing fraction beyond which contacts, which overlap almost fully, no longer bear a pressure.
constexpr double MOST_DENSE = 4.0;

double &entry(Upper &of, int k)
{
  if (k < 3) return of.diagonal[k];
  return k == 3 ? of.xy : k == 4 ? of.xz : of.yz;
}

double entry(const Upper &of, int k)
{
  if (k < 3) return of.diagonal[k];
  return k == 3 ? of.xy : k == 4 ? of.xz : of.yz;
}

[[noreturn]] void wrong(const std::string &what) { throw std::invalid_argument(what); }

}  // namespace

BoxControl::BoxControl(LAMMPS_NS::LAMMPS *lmp, double k_d) :
    Pointers(lmp), box(nullptr), dimension(domain->dimension), rates{}, is_isotropic(false),
    drag(k_d), is_time_given(false), t_box(NAN), stiffness(NAN), measure(NAN), pair(nullptr),
    start{}, last{}, before{}
{
}

/* ----------------------------------------------------------------------
   set-up
------------------------------------------------------------------------- */

BoxControl::Target BoxControl::read_target(const std::string &from, const std::string &to,
                                           bool is_normal) const
{
  Target found;
  found.is_set = true;
  if (from.compare(0, 2, "v_") == 0) {
    found.variable = from.substr(2);
    if (to != from) wrong("targets " + from + " and " + to + ", expected the same variable twice.");
    return found;
  }
  found.from = LAMMPS_NS::utils::numeric(FLERR, from.c_str(), false, lmp);
  found.to = LAMMPS_NS::utils::numeric(FLERR, to.c_str(), false, lmp);
  for (const double each : {found.from, found.to}) {
    if (!std::isfinite(each)) wrong("the target " + from + ", expected a finite number.");
    if (is_normal && each < 0.0) {
      wrong("the pressure " + shown(each) + ", expected 0 or more: contacts push and never pull.");
    }
  }
  return found;
}

int BoxControl::read(int k, int narg, char **arg)
{
  const std::string keyword = arg[k];
  if (keyword == "pressure") {
    if (k + 3 >= narg || std::string(arg[k + 1]) != "iso") {
      wrong("pressure without 'iso START STOP', expected these: 'pressure iso 1e-3 1e-3'.");
    }
    pressure = read_target(arg[k + 2], arg[k + 3], true);
    is_isotropic = true;
    return 4;
  }
  if (keyword == "stress") {
    const std::string name = k + 2 < narg ? arg[k + 1] : "";
    const auto at = std::find(std::begin(NAMES), std::end(NAMES), name) - std::begin(NAMES);
    if (at == 6 || (dimension == 2 && (at == 2 || at > 3))) {
      wrong("stress " + name + ", expected a component" +
            (dimension == 2 ? " xx, yy or xy" : " xx, yy, zz, xy, xz or yz") +
            " and its target: 'stress yy 1e-3'.");
    }
    components[at] = read_target(arg[k + 2], arg[k + 2], at < 3);
    return 3;
  }
  if (keyword != "tbox") return 0;
  if (k + 1 >= narg) wrong("tbox without a number, expected a time.");
  t_box = LAMMPS_NS::utils::numeric(FLERR, arg[k + 1], false, lmp);
  if (!(t_box > 0.0) || !std::isfinite(t_box)) {
    wrong(std::string("tbox ") + arg[k + 1] + ", expected a positive time.");
  }
  is_time_given = true;
  return 2;
}

bool BoxControl::any_component() const
{
  return std::any_of(components.begin(), components.end(),
                     [](const Target &t) { return t.is_set; });
}

bool BoxControl::shears() const
{
  return components[3].is_set || components[4].is_set || components[5].is_set;
}

void BoxControl::drive(const Upper &gradient)
{
  const Vec<3> &d = gradient.diagonal;
  const double trace = d[0] + d[1] + d[2];
  if (is_isotropic && std::fabs(trace) > 1e-15 * (std::fabs(d[0]) + std::fabs(d[1]))) {
    wrong("'pressure iso' and a flow that changes the volume, expected one of them: leave out "
          "'compress', or the pressure.");
  }
  for (int k = 0; k < 6; ++k) {
    if (!components[k].is_set || entry(gradient, k) == 0.0) continue;
    wrong(std::string("'stress ") + NAMES[k] +
          "' and a rate of the same component of the flow, "
          "expected one of them: leave out either.");
  }
  rates = gradient;
}

void BoxControl::require_complete(bool holds_volume) const
{
  const bool changes_volume =
      is_isotropic || components[0].is_set || components[1].is_set || components[2].is_set;
  if (!is_on() && is_time_given) {
    wrong("tbox without a controlled stress, expected 'pressure' or 'stress': leave tbox out or "
          "give one.");
  }
  if (!is_on()) return;
  if (holds_volume && changes_volume) {
    wrong("volume constant and a box that yields to a normal stress, expected 'volume free'.");
  }
  if (is_isotropic && (components[0].is_set || components[1].is_set || components[2].is_set)) {
    wrong("'pressure iso' and a normal component of 'stress', expected one of them.");
  }
}

void BoxControl::yield(AffineBox &of)
{
  box = &of;
  of.let_yield();
}

void BoxControl::begin_run(PairContact &of)
{
  pair = &of;
  stiffness = of.largest_energy();
  double mine = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) {
    mine += of.drag(of.particle_view().semi_axes(i), atom->type[i]).measure;
  }
  MPI_Allreduce(&mine, &measure, 1, MPI_DOUBLE, MPI_SUM, world);
  if (is_time_given) return;
  const double mean = measure / static_cast<double>(atom->natoms);
  t_box = default_box_time(host_viscosity(), mean, stiffness);
}

double BoxControl::host_viscosity() const
{
  const double mean = measure / static_cast<double>(atom->natoms);
  return static_cast<float>(jamshape::host_viscosity(drag, mean, dimension));
}

void BoxControl::aim(Target &at, bool is_normal) const
{
  if (!at.is_set) return;
  if (at.variable.empty()) {
    // In the middle of the step, so that a ramp is followed to second order.
    const double passed = static_cast<double>(update->ntimestep - update->beginstep) - 0.5;
    const double all = static_cast<double>(update->endstep - update->beginstep);
    const double part = all > 0.0 ? std::clamp(passed / all, 0.0, 1.0) : 0.0;
    at.now = at.from + part * (at.to - at.from);
    return;
  }
  const int which = input->variable->find(at.variable.c_str());
  if (which < 0 || !input->variable->equalstyle(which)) {
    error->all(FLERR, "fix overdamped/affine found no equal-style variable " + at.variable +
                          ", expected one: use 'variable " + at.variable + " equal ...'.");
  }
  modify->clearstep_compute();
  at.now = input->variable->compute_equal(which);
  modify->addstep_compute(update->ntimestep + 1);
  if (!std::isfinite(at.now) || (is_normal && at.now < 0.0)) {
    error->all(FLERR, "fix overdamped/affine found " + shown(at.now) + " as the value of v_" +
                          at.variable + ", expected a finite " +
                          (is_normal ? "pressure of 0 or more: contacts push and never pull."
                                     : "stress."));
  }
}

void BoxControl::aim()
{
  aim(pressure, true);
  for (int k = 0; k < 6; ++k) aim(components[k], k < 3);
  const double volume = domain->prd[0] * domain->prd[1] * (dimension == 3 ? domain->prd[2] : 1.0);
  if (measure <= MOST_DENSE * volume) return;
  error->all(FLERR, "fix overdamped/affine found a packing fraction of " + shown(measure / volume) +
                        ", expected at most " + shown(MOST_DENSE) +
                        ": the contacts do not bear the targets, use smaller ones.");
}

/* ----------------------------------------------------------------------
   rates
------------------------------------------------------------------------- */

/// Volume times the stress of the contacts, xx to yz: P_ab is conjugate to the shear of a along b.
std::array<double, 6> BoxControl::stress_times_volume() const
{
  std::array<double, 6> all{};
  MPI_Allreduce(pair->virial, all.data(), 6, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

void BoxControl::follow()
{
  const std::array<double, 6> found = stress_times_volume();
  double volume = 1.0, mean = 0.0;
  for (int k = 0; k < dimension; ++k) {
    volume *= domain->prd[k];
    mean += found[k] / dimension;
  }
  const double target_volume = volume / force->nktv2p;
  const double zeta_volume = t_box * stiffness * static_cast<double>(atom->natoms);
  Upper rate = rates;
  if (is_isotropic) {
    const double g = (mean - pressure.now * target_volume) / zeta_volume;
    for (int k = 0; k < dimension; ++k) rate.diagonal[k] += g;
  }
  for (int k = 0; k < 6; ++k) {
    if (!components[k].is_set) continue;
    entry(rate, k) = (found[k] - components[k].now * target_volume) / zeta_volume;
  }
  box->set_rate(rate);
}

double BoxControl::largest_rate() const
{
  double mine = 0.0, all;
  pair->for_each_bond([&](const LocalBond &b) {
    const double share = force->newton_pair || b.j < atom->nlocal ? 1.0 : 0.5;
    mine += share * b.stiffness * norm_sq(b.arm_j - b.arm_i);
  });
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all / (t_box * stiffness * static_cast<double>(atom->natoms));
}

/* ----------------------------------------------------------------------
   stages
------------------------------------------------------------------------- */

void BoxControl::hold(bigint step, double after)
{
  start = box->state().rate;
  box->go_on_from(step, after);
  last = before = Upper{};
}

/// The rate of omega, of which F = exp(omega) F_0, to the order of the methods:
/// G - [omega, G] / 2 (Hairer, Lubich & Wanner, Geometric Numerical Integration, Sec. III.4).
Upper BoxControl::in_omega(const Upper &rate) const
{
  return rate + -0.5 * (last * rate + -1.0 * (rate * last));
}

Upper BoxControl::sum_of(double stored, double present, double of_last, double of_before) const
{
  Upper sum = stored * start;
  if (present != 0.0) sum = sum + present * in_omega(box->state().rate);
  if (of_last != 0.0) sum = sum + of_last * last;
  if (of_before != 0.0) sum = sum + of_before * before;
  return sum;
}

Upper BoxControl::moved(double stored, double present, double of_last, double of_before)
{
  const Upper omega = sum_of(stored, present, of_last, of_before);
  before = last;
  last = omega;
  return box->moved(omega);
}

double BoxControl::length_of(double stored, double present, double of_last) const
{
  const Upper sum = sum_of(stored, present, of_last, 0.0);
  return std::sqrt(norm_sq(sum.diagonal) + sum.xy * sum.xy + sum.xz * sum.xz + sum.yz * sum.yz);
}

void BoxControl::settle(bigint step, double after, double h)
{
  Vec<3> sheared{{last.xy, last.xz, last.yz}};
  for (int k = 0; k < 3; ++k) {
    if (!components[3 + k].is_set) sheared[k] = h * entry(rates, 3 + k);
  }
  box->settle(step, after, {last, sheared, h});
}

}  // namespace jamshape
