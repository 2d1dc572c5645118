#include "affine_box.h"

#include "domain.h"
#include "update.h"

#include <algorithm>
#include <cmath>

namespace jamshape {

using LAMMPS_NS::bigint;
using LAMMPS_NS::imageint;

namespace {

bool operator==(const Upper &a, const Upper &b)
{
  return std::equal(a.diagonal.c, a.diagonal.c + 3, b.diagonal.c) && a.xy == b.xy && a.xz == b.xz &&
         a.yz == b.yz;
}

Vec<3> vec3(const double *from) { return {{from[0], from[1], from[2]}}; }

}  // namespace

AffineBox::AffineBox(LAMMPS_NS::LAMMPS *lmp, const Upper &gradient, Reference fixed_point) :
    Pointers(lmp), fixed(fixed_point), dimension(domain->dimension), now{}, next_rate(gradient),
    time_base(0.0), late(0.0), reached_step(update->ntimestep), started(false), yields(false),
    left{}
{
  now.rate = gradient;
}

AffineBox::State AffineBox::saved_state() const
{
  State found = now;
  found.step_base += update->ntimestep - reached_step;
  return found;
}

void AffineBox::restore(const State &from, double time_until_base)
{
  now = from;
  late = 0.0;
  time_base = time_until_base;
  reached_step = update->ntimestep;
  started = from.dt != 0.0;  // the fix had run
}

bool AffineBox::begin_run(bigint step)
{
  now.step_base += step - reached_step;
  reached_step = step;
  const bool was_started = started, continues = started && is_in_box(bounds(deformation(step)));
  if (continues) {
    follow_timestep();
    if (!yields && !(now.rate == next_rate)) follow_gradient(step);
  } else {
    start_here(step);
  }
  now.dt = update->dt;
  started = true;
  left = present_bounds();
  return continues || !was_started;
}

void AffineBox::follow_gradient(bigint step)
{
  go_on_from(step);
  now.rate = next_rate;
  set_box(deformation(step));  // without the rounding errors of flips
}

bool AffineBox::follow_timestep()
{
  if (now.dt == update->dt) return false;
  go_on_from(reached_step);
  now.dt = update->dt;
  return true;
}

bool AffineBox::is_as_left() const { return is_in_box(left); }

AffineBox::Bounds AffineBox::present_bounds() const
{
  return {vec3(domain->boxlo), vec3(domain->boxhi), domain->xy, domain->xz, domain->yz};
}

bool AffineBox::is_in_box(const Bounds &at) const
{
  const Bounds present = present_bounds();
  return at.xy == present.xy && at.xz == present.xz && at.yz == present.yz &&
         std::equal(at.lo.c, at.lo.c + 3, present.lo.c) &&
         std::equal(at.hi.c, at.hi.c + 3, present.hi.c);
}

void AffineBox::start_here(bigint step)
{
  now = State{};
  time_base = late = 0.0;
  for (int k = 0; k < 3; ++k) {
    now.lo[k] = domain->boxlo[k];
    now.hi[k] = domain->boxhi[k];
  }
  if (domain->triclinic) {
    now.xy = domain->xy;
    now.xz = domain->xz;
    now.yz = domain->yz;
  }
  now.rate = next_rate;
  now.step_base = step;
}

void AffineBox::go_on_from(bigint step, double after)
{
  const double passed = elapsed(step) + after;
  const Upper present = deformation(step, after);
  now.stretch_base = stretch(passed);
  time_base += passed;
  const double shears[3] = {present.xy, present.xz, present.yz};
  const double rates[3] = {now.rate.xy, now.rate.xz, now.rate.yz};
  for (int k = 0; k < 3; ++k) {
    now.base[k] = shears[k];
    now.sheared[k] += rates[k] * passed;
  }
  now.flips = {0.0, 0.0, 0.0};
  now.step_base = step;
  late = after;
}

Upper AffineBox::moved(const Upper &omega) const
{
  Upper found = exponential(omega) * unflipped(0.0);
  for (int k = 0; k < 3; ++k) {
    found.diagonal[k] = std::exp(now.stretch_base[k] + omega.diagonal[k]);
  }
  return found;
}

void AffineBox::settle(bigint step, double after, const Motion &by)
{
  const Upper present = moved(by.omega);
  now.stretch_base = now.stretch_base + by.omega.diagonal;
  time_base += by.h;
  const double shears[3] = {present.xy, present.xz, present.yz};
  for (int k = 0; k < 3; ++k) {
    now.base[k] = shears[k];
    now.sheared[k] += by.sheared[k];
  }
  now.step_base = step;
  late = after;
}

/// Time since `step_base`.
double AffineBox::elapsed(bigint step) const
{
  return static_cast<double>(step - now.step_base) * now.dt - late;
}

double AffineBox::time(bigint step) const { return time_base + elapsed(step); }

/// Logarithms of the diagonal of F.
Vec<3> AffineBox::stretch(double passed) const
{
  Vec<3> found;
  for (int k = 0; k < 3; ++k) found[k] = now.stretch_base[k] + now.rate.diagonal[k] * passed;
  return found;
}

double AffineBox::strain(bigint step) const
{
  const Vec<3> log = stretch(elapsed(step));
  double uneven = 0.0;
  for (int k = 1; k < dimension; ++k) uneven += log[k] - log[0];
  return -(log[0] + uneven / dimension);
}

double AffineBox::shear_strain(bigint step) const
{
  return now.sheared[0] + now.rate.xy * elapsed(step);
}

double AffineBox::pure_strain(bigint step) const
{
  const Vec<3> log = stretch(elapsed(step));
  return 0.5 * (log[0] - log[1]);
}

double AffineBox::speed_of(const Upper &g)
{
  const Vec<3> &d = g.diagonal;
  return std::max({std::abs(d[0]) + std::abs(g.xy) + std::abs(g.xz),
                   std::abs(d[1]) + std::abs(g.yz), std::abs(d[2])});
}

bool AffineBox::is_isotropic() const
{
  const Vec<3> &d = now.rate.diagonal;
  return !now.rate.has_shear() && d[0] == d[1] && (dimension == 2 || d[0] == d[2]);
}

/// F without the flips.
Upper AffineBox::unflipped(double passed) const
{
  Upper base{{}, now.base[0], now.base[1], now.base[2]};
  for (int k = 0; k < 3; ++k) base.diagonal[k] = std::exp(now.stretch_base[k]);
  Upper found = exponential(passed * now.rate) * base;
  const Vec<3> log = stretch(passed);
  for (int k = 0; k < 3; ++k) found.diagonal[k] = std::exp(log[k]);
  return found;
}

Upper AffineBox::deformation(bigint step, double time_after) const
{
  const Upper found = unflipped(elapsed(step) + time_after);
  return now.flips.is_none() ? found : found * flips_in_reference(now.flips);
}

/* ----------------------------------------------------------------------
   the cell
------------------------------------------------------------------------- */

Upper AffineBox::cell_at_start() const
{
  return {vec3(now.hi) - vec3(now.lo), now.xy, now.xz, now.yz};
}

Vec<3> AffineBox::fixed_point() const
{
  if (fixed == Reference::CORNER) return vec3(now.lo);
  const Vec<3> tilts{{now.xy + now.xz, now.yz, 0.0}};
  Vec<3> found;
  for (int k = 0; k < 3; ++k) found[k] = 0.5 * (now.lo[k] + now.hi[k] + tilts[k]);
  return found;
}

AffineBox::Bounds AffineBox::bounds(const Upper &deformation) const
{
  const Vec<3> point = fixed_point();
  const Upper cell = deformation * cell_at_start();
  const Vec<3> lo = vec3(now.lo), from_point = lo - point;
  const Upper shear{{}, deformation.xy, deformation.xz, deformation.yz};
  const Vec<3> sheared = shear * from_point;
  Bounds found{lo, vec3(now.hi), cell.xy, cell.xz, cell.yz};
  for (int k = 0; k < dimension; ++k) {
    const double stretch = deformation.diagonal[k];
    found.lo[k] = point[k] + (stretch * (now.lo[k] - point[k]) + sheared[k]);
    found.hi[k] = point[k] + (stretch * (now.hi[k] - point[k]) + sheared[k]);
  }
  return found;
}

void AffineBox::set_box(const Upper &deformation)
{
  const Bounds at = bounds(deformation);
  left = at;
  std::copy_n(at.lo.c, 3, domain->boxlo);
  std::copy_n(at.hi.c, 3, domain->boxhi);
  if (domain->triclinic) {
    domain->xy = at.xy;
    domain->xz = at.xz;
    domain->yz = at.yz;
  }
  domain->set_global_box();
  domain->set_local_box();
}

Vec<3> AffineBox::reference(const double *x, imageint image, const Upper &deformation) const
{
  const Vec<3> images = image_counts(image), turns = cell_at_start() * images;
  const Vec<3> offset = vec3(x) - fixed_point();
  const Upper shear = divided(1.0, deformation);
  const Vec<3> sheared = Upper{{}, shear.xy, shear.xz, shear.yz} * offset;
  Vec<3> y{};
  for (int k = 0; k < dimension; ++k) {
    y[k] = offset[k] / deformation.diagonal[k] + sheared[k] + turns[k];
  }
  return y;
}

Vec<3> AffineBox::recounted(const Vec<3> &reference, imageint image) const
{
  const Upper cell = cell_at_start();
  const Vec<3> apart = divided(1.0, cell) * reference - image_counts(image);
  Vec<3> turns{};
  for (int k = 0; k < dimension; ++k) turns[k] = -IMAGES * std::nearbyint(apart[k] / IMAGES);
  return cell * turns;
}

AffineBox::Flip AffineBox::flip_needed(bigint step, double most) const
{
  const Upper cell = deformation(step) * cell_at_start();
  const Vec<3> &edge = cell.diagonal;
  const auto turns = [&](double tilt, double along) {
    return std::abs(tilt) > most * along ? -std::nearbyint(tilt / along) : 0.0;
  };
  Flip found{turns(cell.xy, edge[0]), 0.0, turns(cell.yz, edge[1])};
  // c takes along the tilt of the new b.
  found.n = turns(cell.xz + found.p * cell.xy, edge[0]);
  return found;
}

/// H M H^-1 with H the cell at strain 0 and M the flip: maps coordinates of the new cell vectors to
/// those of the old.
Upper AffineBox::flips_in_reference(const Flip &by) const
{
  const Upper cell = cell_at_start();
  return cell * Upper{{{1.0, 1.0, 1.0}}, by.m, by.n, by.p} * divided(1.0, cell);
}

Upper AffineBox::flip(const Flip &by)
{
  // The product of both flips, whose entries are integers.
  Flip &all = now.flips;
  all = {all.m + by.m, all.n + by.n + all.m * by.p, all.p + by.p};
  return divided(1.0, flips_in_reference(by));
}

}  // namespace jamshape
