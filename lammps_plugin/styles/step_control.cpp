#include "step_control.h"

#include "text.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace jamshape {

using LAMMPS_NS::bigint;

namespace {

// Step size controller: proportional and integral (Hairer & Wanner, Solving Ordinary Differential
// Equations II, Sec. IV.2), with limits of the change from one substep to the next.
constexpr double TARGET = 0.5, OF_ERROR = 0.7, OF_ERROR_BEFORE = 0.4;
constexpr double LARGEST_GROWTH = 5.0, SMALLEST_GROWTH = 0.2, SMALLEST_CUT = 0.1, LARGEST_CUT = 0.6;
constexpr double SMALLEST_ERROR = 1e-8;

/// The rate is estimated from below, and closing contacts may raise it before the next estimate.
constexpr double MARGIN_OF_RATE = 1.15, ERROR_OF_RATE = 0.02;

/// The estimate also lacks the prestress and the curvature of the energy, which may be stiffer than
/// the bonds: the margin follows the rate seen in the substeps, up to this, and decays slowly.
constexpr double LARGEST_MARGIN = 12.0, MEMORY_OF_MARGIN = 0.98;

/// Estimates are renewed after this many times their cost in forces: 5 % of the total.
constexpr bigint REFRESH = 20;
constexpr bigint REJECTIONS_TO_REFRESH = 4;  // and after this many failed substeps

/// Longest substep as a strain of the box.
constexpr double LARGEST_STRAIN = 1e-3;

/// Smallest substep, over the square root of the tolerance over the fastest rate.
constexpr double SMALLEST_STEP = 0.5;

/// Below this fraction of the smallest substep even a freely moving particle went too far.
constexpr double NO_PROGRESS = 1e-9;

}  // namespace

StepControl::StepControl(AffineBox &affine_box, double tol) :
    box(affine_box), tolerance(tol), now{}, last{}
{
}

void StepControl::begin_run(OverdampedFlow &flow)
{
  if (now.h == 0.0) refresh(flow);
}

void StepControl::step(OverdampedFlow &flow, bigint to, double dt)
{
  last = {dt, 0.0, 0.0};
  Span left{box, to - 1, 0.0, dt, true, 0.0};
  while (left.h > 0.0) {
    refresh(flow);
    BoxControl *const control = flow.control();
    if (control) control->hold(to - 1, left.begin);
    flow.hold_start(left.from());
    const double h = substep(flow, left);
    const bool ends = h == left.h;
    left.begin = ends ? dt : left.begin + h;
    left.h = dt - left.begin;
    if (control) control->settle(ends ? to : to - 1, ends ? 0.0 : left.begin, h);
  }
}

double StepControl::error_of(OverdampedFlow &flow, const OverdampedFlow::Move &sum) const
{
  const double of_particles = flow.rms_of(sum);
  const BoxControl *const control = flow.control();
  if (!control) return of_particles;
  return std::hypot(of_particles,
                    now.touching.reach * control->length_of(sum.stored, sum.present, sum.last));
}

/// Estimates the rate and the overlaps, at a state with forces.
void StepControl::refresh(OverdampedFlow &flow)
{
  const bool begins = now.h == 0.0;
  const bigint before = flow.n_evaluations();
  if (begins || now.touching_age >= REFRESH) {
    now.touching = flow.touching();
    now.touching_age = 0;
  }
  const bool unknown = now.rate == 0.0 && now.touching.bonds > 0.0;
  if (begins || unknown || now.rate_age >= REFRESH * now.rate_cost) {
    const bigint start = flow.n_evaluations();
    now.rate = flow.largest_rate(ERROR_OF_RATE);
    if (flow.control()) now.rate += flow.control()->largest_rate();
    now.rate_cost = std::max<bigint>(flow.n_evaluations() - start, 1);
    now.rate_age = 0;
  }
  if (begins) {
    now.error_before = 1.0;
    now.margin = MARGIN_OF_RATE;
    now.h = now.rate > 0.0 ? std::sqrt(tolerance) / now.rate : box.state().dt;
  }
  now.touching_age += flow.n_evaluations() - before;
}

/// The next substep of the remainder of the step of LAMMPS; never a small remainder.
StepControl::Span StepControl::choose(const Span &left) const
{
  Span span = left;
  const double speed = box.speed(), rate = now.margin * now.rate;
  double h = now.h;
  if (rate > 0.0) h = std::min(h, stability_interval() / rate);
  if (speed > 0.0) h = std::min(h, LARGEST_STRAIN / speed);
  if (h < left.h) {
    span.h = h < 0.5 * left.h ? h : 0.5 * left.h;
    span.is_last = false;
  }
  span.z = span.h * rate;
  return span;
}

double StepControl::substep(OverdampedFlow &flow, const Span &left)
{
  const bigint before = flow.n_evaluations();
  for (bool was_rejected = false;; was_rejected = true) {
    const Span span = choose(left);
    const double length = attempt(flow, span);
    if (now.touching.bonds == 0.0 && length > 0.0 && std::isfinite(length)) {
      now.touching = flow.touching();  // contacts that closed in this substep
      now.touching_age = 0;
    }
    widen_margin(flow.rate_seen());
    const double error = length / allowed_error(flow, span);
    const bool is_forced = !(error <= 1.0) && std::isfinite(error) && span.h <= smallest_step();
    if (error <= 1.0 || is_forced) {
      now.forced += is_forced;
      last.error = std::max(last.error, tolerance * error);
      accept(flow, span, error, was_rejected);
      now.rate_age += flow.n_evaluations() - before;
      now.touching_age += flow.n_evaluations() - before;
      return span.h;
    }
    ++now.rejected;
    if (flow.control()) flow.control()->try_again();
    const double cut = std::pow(error / TARGET, -1.0 / order_of_error());
    now.h = span.h * std::clamp(std::isfinite(error) ? cut : 0.0, SMALLEST_CUT, LARGEST_CUT);
    if (std::isfinite(error)) now.h = std::max(now.h, smallest_step());
    now.rate_age += REFRESH * now.rate_cost / REJECTIONS_TO_REFRESH;
    require_progress(flow, now.h);
  }
}

void StepControl::widen_margin(double rate_seen)
{
  const double seen = now.rate > 0.0 ? MARGIN_OF_RATE * rate_seen / now.rate : 0.0;
  const double remembered = MARGIN_OF_RATE + MEMORY_OF_MARGIN * (now.margin - MARGIN_OF_RATE);
  now.margin = std::max(remembered, std::min(seen, LARGEST_MARGIN));
}

void StepControl::accept(OverdampedFlow &flow, const Span &span, double error, bool was_rejected)
{
  finish(flow, span);
  if (!span.is_last && !has_forces_at_end()) flow.evaluate_forces();
  ++now.accepted;
  last.shortest = std::min(last.shortest, span.h);
  last.stages = std::max(last.stages, stages(span.z));

  error = std::max(error, SMALLEST_ERROR);
  const double order = order_of_error();
  double growth = std::pow(error / TARGET, -OF_ERROR / order) *
                  std::pow(now.error_before / TARGET, OF_ERROR_BEFORE / order);
  growth = std::clamp(growth, SMALLEST_GROWTH, was_rejected ? 1.0 : LARGEST_GROWTH);
  const bool was_clipped = span.h < now.h;  // by the end of the step of LAMMPS
  if (was_clipped && growth >= 1.0) {
    now.h = std::max(now.h, growth * span.h);
  } else {
    now.h = growth * span.h;
    now.error_before = std::min(error, 1.0);
  }
  now.h = std::max(now.h, smallest_step());
}

/// Tolerance as a length. Overlaps are bounded below by the distance that the box's motion pushes a
/// single contact, and errors by the rounding of coordinates.
double StepControl::allowed_error(const OverdampedFlow &flow, const Span &span) const
{
  const OverdampedFlow::Touching &t = now.touching;
  const double pushed = t.rate > 0.0 ? box.speed() * t.reach / t.rate : 0.0;
  const double rounding = std::numeric_limits<double>::epsilon() * flow.largest_edge();
  return tolerance * std::max(t.overlap, pushed) + (1.0 + span.z) * rounding;
}

/// Smooth motion and closing contacts meet the tolerance with longer steps, even if the
/// displacement of the fastest mode is as large as the overlaps. Only jumps of the force (`sides
/// one`) need smaller ones: they make particles chatter, the less the smaller the step, without
/// end.
double StepControl::smallest_step() const
{
  const double rate = std::max(now.rate, now.touching.rate);
  return rate > 0.0 ? SMALLEST_STEP * std::sqrt(tolerance) / rate : 0.0;
}

void StepControl::require_progress(const OverdampedFlow &flow, double h) const
{
  if (h > NO_PROGRESS * std::max(smallest_step(), 1e-9 * box.state().dt)) return;
  flow.stop("found that a time step of " + shown(h) +
            " still moves a particle by more than a quarter of its radius, expected overlaps that "
            "can be resolved: start from a state with smaller ones.");
}

}  // namespace jamshape
