#pragma once

#include "landscape/newton_system.hpp"
#include "landscape/quasi_newton.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <Eigen/Core>
#include <functional>
#include <utility>
#include <vector>

namespace jamshape {

/// Stopping criteria of a minimisation, and its options.
struct DescentStop {
  double tolerance;          // converged below this residual
  double lowest;             // unjammed below this energy
  std::int64_t evaluations;  // exhausted after this many
  double seconds;            // or after this time
  double rounding;           // residual due to rounding of doubles, times the mean force of a bond
  std::int64_t patience;     // stalled after this many without a gain
  double newton_below;       // residual below which Newton's method by factors replaces L-BFGS
  bool is_near;              // also starts with Newton's method, as long as that gains
  StepBounds step;
};

enum class DescentOutcome { CONVERGED, UNJAMMED, STALLED, EXHAUSTED };

/// One row for each reported state.
struct DescentRow {
  double seconds;
  std::int64_t evaluations;
  double residual, energy_density;
};

/// The final state, at the base of the local energy model.
struct DescentEnd {
  DescentOutcome outcome;
  LandscapeSums sums;
  std::vector<DescentRow> rows;
  std::int64_t evaluations;
  int factorisations, products;
};

/// Largest net force or torque of a particle over the mean force of a bond (Marschall & Teitel
/// 2018, App. A).
inline double residual_of(const LocalEnergyModel &about, const LandscapeSums &sums)
{
  if (sums.n_bonds == 0) return 0.0;
  return about.largest_part(sums.gradient.data()) / (sums.bond_force / sums.n_bonds);
}

/// Bracket of the zero of the slope along a line, from 0 where it is negative, to 1.
class Bracket {
 public:
  /// Factor by which a bracket grows while it is open.
  static constexpr double WIDER = 10.0;

  explicit Bracket(double slope) : low_slope(slope) {}

  /// Takes in a point and proposes the next one.
  double next(double at, double slope)
  {
    double corner = NAN;
    if (slope > 0.0) {
      if (std::isfinite(high_slope) && high_slope > slope) {
        corner = at - slope * (high - at) / (high_slope - slope);
      }
      high = at;
      high_slope = slope;
    } else {
      low = at;
      low_slope = slope;
    }
    if (!std::isfinite(high)) return std::min(1.0, WIDER * at);
    if (low < corner && corner < high) {  // slightly beyond, so that the contact is closed
      return corner + 1e-3 * (high - corner);
    }
    const double part = -low_slope / (high_slope - low_slope);
    return low + (high - low) * (part > CORNER ? part : 0.5);
  }

 private:
  /// A slope that rises by more than the inverse of this does so at a kink, wherever that is.
  static constexpr double CORNER = 0.1;

  double low = 0.0, low_slope, high = INFINITY, high_slope = INFINITY;
};

/// Minimises the energy at fixed box: by L-BFGS, cheap while contacts open and close, and by
/// Newton's method once they stay. The base of the local energy model moves along.
class Descent {
 public:
  using Vector = Eigen::VectorXd;
  /// Receives progress reports; may throw to stop.
  using Tell = std::function<void(const DescentRow &)>;

  Descent(LocalEnergyModel &landscape, const DescentStop &when, double first_shift) :
      about(landscape), stop(when), system(landscape, first_shift),
      memory(landscape.dimension() == 2 ? REMEMBERED_IN_2D : REMEMBERED_IN_3D),
      by_newton(when.is_near), is_near(when.is_near),
      newton_below(when.newton_below * (landscape.has_complete_factors() ? 1.0 : BY_ITERATIONS))
  {
  }

  Tell tell;

  DescentEnd run()
  {
    const Remembering remembering(about);
    LandscapeSums sums = first();
    if (sums.is_refused()) return end(DescentOutcome::STALLED, std::move(sums));
    while (true) {
      record(sums);
      DescentOutcome outcome;
      if (is_over(sums, outcome)) {
        if (outcome != DescentOutcome::CONVERGED || !leave_saddle(sums)) {
          return end(outcome, std::move(sums));
        }
        continue;
      }
      choose_method();
      const Vector step = direction(sums);
      Line line = search_along(step, sums);
      if (line.sums.is_refused()) return end(DescentOutcome::STALLED, std::move(sums));
      learn(line, sums);
      here += line.step;
      if (by_newton || far || extended || !about.adds_up()) move_base();
      sums = std::move(line.sums);
    }
  }

 private:
  using Clock = std::chrono::steady_clock;

  /// A gain of a method is a fall of the energy or of the residual below these fractions of its
  /// lowest value; either may fall for long while the other does not. While rods slide both hardly
  /// fall, but contacts close one by one until a minimum is reached: that counts for Newton's
  /// method.
  static constexpr double LESS_ENERGY = 0.98, LESS_RESIDUAL = 0.7;
  /// Without complete factors Newton's method takes over below this multiple of the residual: a
  /// step of it lets contacts open and close as one of L-BFGS does, and costs as much as tens of
  /// them.
  static constexpr double BY_ITERATIONS = 0.01;
  /// L-BFGS gains in waves: Newton's method takes over only after this many evaluations without a
  /// gain.
  static constexpr std::int64_t SLOW = 2000;

  /// L-BFGS resumes if Newton's method has moved to another region of the landscape: above this
  /// multiple of the residual at which Newton's method starts. With complete factors this happens a
  /// few times; without them, where a step costs as much as tens of L-BFGS steps, repeatedly, at
  /// ever smaller residuals.
  static constexpr double AWAY = 30.0, LATER = 0.3;
  static constexpr int MOST_RETURNS = 5;

  /// With complete factors it also resumes, any number of times, if the energy is below this
  /// fraction of that at which Newton's method took over, after this many evaluations: it follows
  /// long slides at a fraction of the price, since a step of Newton's method ends at the first
  /// contact that closes. A start declared near a minimum counts as fallen.
  static constexpr double FALLEN = 0.97;
  static constexpr std::int64_t NEAR = 250;

  /// Without them it resumes if a start declared near a minimum is not near one after this many.
  static constexpr std::int64_t NEAR_BY_ITERATIONS = 40;

  /// Largest number of saddles left in one minimisation.
  static constexpr int MOST_SADDLES = 5;
  /// Smallest negative curvature at a saddle, over the mean force of a bond over the longest step.
  static constexpr double CURVED = 1e-3;
  /// Step off a saddle, over the overlaps.
  static constexpr double OFF_SADDLE = 0.3;

  /// Smallest shift of the Hessian whose factors start L-BFGS, over its largest diagonal element of
  /// displacements or of rotations.
  static constexpr double SOFT = 0.1;
  /// Factor of this shift if a pivot is not positive.
  static constexpr double STIFFEN = 3.0;
  /// Steps that L-BFGS remembers: fewer in 2D, where an evaluation costs no more than their
  /// vectors; in 3D a short memory takes more evaluations.
  static constexpr std::size_t REMEMBERED_IN_2D = 12, REMEMBERED_IN_3D = 20;
  /// Steps of L-BFGS after which the factors are recomputed.
  static constexpr int REFRESH = 60;

  /// Rounding above which extended precision takes over, over the residual and over the tolerance.
  static constexpr double OF_RESIDUAL = 0.01, OF_TOLERANCE = 0.1;
  /// Doubles suffice again where the residual has risen by this factor, as where particles slide.
  static constexpr double AGAIN = 10.0;

  /// Newton's equations are solved to this relative accuracy, or to the square root of the
  /// residual.
  static constexpr double COARSE = 0.1;

  static constexpr int TRIES = 25;
  static constexpr double TELL_SECONDS = 0.2;

  /// Contacts start from the previous ones, as long as this object lives.
  class Remembering {
   public:
    explicit Remembering(LocalEnergyModel &landscape) : about(landscape) { about.remember(true); }
    ~Remembering() { about.remember(false); }
    Remembering(const Remembering &) = delete;
    Remembering &operator=(const Remembering &) = delete;

   private:
    LocalEnergyModel &about;
  };

  struct Line {
    Vector step;
    LandscapeSums sums;
    double factor;
  };

  LocalEnergyModel &about;
  Vector here = Vector::Zero(static_cast<Eigen::Index>(about.n()));  // from the base
  bool far = false;  // whether pairs were renewed since the base last moved
  DescentStop stop;
  NewtonSystem system;
  QuasiNewton memory;
  bool by_newton, is_near;
  double newton_below;
  int age = 0, preconditioned = 0, saddles = 0, returns = 0;
  std::shared_ptr<Factors> near;
  std::vector<DescentRow> rows;
  DescentRow taken_over{0.0, 0, 0.0, INFINITY};  // where the present method took over
  std::int64_t evaluations = 0;
  double least_energy = INFINITY, least_residual = INFINITY;
  std::size_t most_bonds = 0;  // since the energy or the residual gained
  double reach = 1.0;  // first fraction of a Newton step to try: closing contacts stop steps alike
  std::int64_t best = 0;       // when the present method gained
  std::int64_t last_gain = 0;  // when any method gained
  bool extended = false;
  Clock::time_point began = Clock::now(), told = began;

  DescentEnd end(DescentOutcome outcome, LandscapeSums sums)
  {
    move_base();
    if (!sums.is_refused()) {
      ++evaluations;
      sums = about.evaluate({here.data(), 0.0}, {extended, true});
    }
    return {outcome,
            std::move(sums),
            std::move(rows),
            evaluations,
            system.factorisations + preconditioned,
            system.products};
  }

  /// Moves the base along: seldom, as long as doubles hold the displacements from there and
  /// nothing else needs it.
  void move_base()
  {
    about.move({here.data(), 0.0});
    here.setZero();
    far = false;
  }

  double residual() const { return rows.back().residual; }
  double accuracy() const { return std::min(COARSE, std::sqrt(residual())); }

  void choose_method()
  {
    if (by_newton) {
      if (!is_astray()) return;
      if (!is_near && !is_sliding()) ++returns;
      if (!is_near && !about.has_complete_factors()) newton_below *= LATER;
      is_near = false;
      memory.forget();
    } else if (residual() >= newton_below && evaluations <= best + SLOW) {
      return;
    }
    by_newton = !by_newton;
    move_base();
    best = evaluations;
    taken_over = rows.back();
  }

  /// Whether the packing slides into another region of the landscape, and is not near its end.
  bool is_sliding() const
  {
    return about.has_complete_factors() && residual() >= newton_below &&
           rows.back().energy_density < FALLEN * taken_over.energy_density &&
           evaluations > taken_over.evaluations + NEAR;
  }

  /// Whether Newton's method should be left while contacts still open and close.
  bool is_astray() const
  {
    const bool is_complete = about.has_complete_factors();
    if (is_sliding()) return true;
    if (is_near) {
      return !is_complete && residual() >= newton_below && evaluations > NEAR_BY_ITERATIONS;
    }
    if (is_complete && returns == MOST_RETURNS) return false;
    return residual() >= AWAY * newton_below;
  }

  Vector direction(const LandscapeSums &sums)
  {
    Vector step;
    if (by_newton) {
      system.prepare();
      step = system.direction(sums.gradient, accuracy());
    } else {
      if (age % REFRESH == 0) precondition();
      ++age;
      step = memory.direction(sums.gradient, *near);
      if (!(step.dot(sums.gradient) < 0.0)) {
        memory.forget();
        step = -near->solve(sums.gradient);
      }
    }
    return about.part_within(step.data(), stop.step) * step;
  }

  /// Takes a matrix near the Hessian as the initial one of L-BFGS. Its shift makes factors without
  /// fill-in nearly as good as complete ones, at a fraction of the price.
  void precondition()
  {
    move_base();
    about.differentiate({here.data(), 0.0}, Fill::NONE);
    Vector shift = SOFT * about.largest_of_kind();
    // The error of incomplete factors is of the same size for all coordinates.
    if (!about.has_complete_factors()) shift.setConstant(shift.maxCoeff());
    const double least = LEAST_SHIFT * shift.maxCoeff();
    shift = shift.cwiseMax(least > 0.0 ? least : 1.0);
    while (!(near = about.factors(shift))) {
      shift *= STIFFEN;
      if (!shift.allFinite()) throw std::runtime_error("The Hessian cannot be factorised.");
    }
    ++preconditioned;
  }

  /// Steps off a saddle with balanced forces, such as one of a symmetric arrangement, to lower
  /// energy: by a fraction of the overlaps along a direction whose negative curvature exceeds a
  /// small fraction of the prestress.
  bool leave_saddle(LandscapeSums &sums)
  {
    if (!by_newton || saddles == MOST_SADDLES || sums.n_bonds == 0) return false;
    system.prepare();
    const double prestress = sums.bond_force / sums.n_bonds / stop.step.longest;
    const auto falling = system.falling(CURVED * prestress);
    if (!falling) return false;
    const double overlap = 2.0 * sums.energy / sums.bond_force;
    const double along = falling->dot(sums.gradient) > 0.0 ? -1.0 : 1.0;
    const Vector step = along * OFF_SADDLE * overlap / falling->cwiseAbs().maxCoeff() * *falling;
    LandscapeSums there = evaluate(step);
    if (there.is_refused()) return false;
    here += step;
    move_base();
    sums = std::move(there);
    memory.forget();
    ++saddles;
    return true;
  }

  void learn(const Line &line, const LandscapeSums &from)
  {
    if (by_newton) {
      system.learn(line.factor, line.sums.n_bonds > from.n_bonds);
    } else {
      memory.learn(line.step, line.sums.gradient - from.gradient);
    }
  }

  LandscapeSums first() { return evaluate(here); }

  /// Evaluates at a step from here.
  LandscapeSums evaluate(const Vector &step)
  {
    const Vector x = here + step;
    const Displacement at{x.data(), 0.0};
    far |= about.renew_pairs(at);
    ++evaluations;
    LandscapeSums sums = about.evaluate(at, {extended, false});
    if (!extended && !sums.is_refused() && needs_more_digits(sums)) {
      extended = true;
      ++evaluations;
      return about.evaluate(at, {extended, false});
    }
    return sums;
  }

  bool needs_more_digits(const LandscapeSums &sums) const
  {
    const double left = rounding_of(sums);
    return left > OF_TOLERANCE * stop.tolerance && left > OF_RESIDUAL * residual_of(about, sums);
  }

  /// Residual that rounding of doubles leaves.
  double rounding_of(const LandscapeSums &sums) const
  {
    return sums.n_bonds == 0 ? 0.0 : stop.rounding / (sums.bond_force / sums.n_bonds);
  }

  void record(const LandscapeSums &sums)
  {
    const double seconds = std::chrono::duration<double>(Clock::now() - began).count();
    double volume = 1.0;
    const int D = about.dimension();
    for (int k = 0; k < D; ++k) volume *= about.poses().cell[0][(D + 1) * k];
    rows.push_back({seconds, evaluations, residual_of(about, sums), sums.energy / volume});
    const double left = rows.back().residual, density = rows.back().energy_density;
    extended = extended && rounding_of(sums) > OF_RESIDUAL / AGAIN * left;
    if (density < LESS_ENERGY * least_energy || left < LESS_RESIDUAL * least_residual) {
      last_gain = best = evaluations;
      least_energy = std::min(least_energy, density);
      least_residual = std::min(least_residual, left);
      most_bonds = sums.n_bonds;
    } else if (by_newton && sums.n_bonds > most_bonds) {
      last_gain = best = evaluations;
      most_bonds = sums.n_bonds;
    }
    if (std::chrono::duration<double>(Clock::now() - told).count() > TELL_SECONDS) {
      told = Clock::now();
      tell(rows.back());
    }
  }

  bool is_over(const LandscapeSums &sums, DescentOutcome &outcome) const
  {
    if (sums.energy <= stop.lowest) {
      outcome = DescentOutcome::UNJAMMED;
    } else if (residual() <= stop.tolerance) {
      outcome = DescentOutcome::CONVERGED;
    } else if (evaluations >= stop.evaluations || rows.back().seconds >= stop.seconds) {
      outcome = DescentOutcome::EXHAUSTED;
    } else if (evaluations > last_gain + SLOW + 2 * stop.patience ||
               (by_newton && evaluations > best + stop.patience)) {
      outcome = DescentOutcome::STALLED;
    } else {
      return false;
    }
    return true;
  }

  /// Line search for a point where the projected force has fallen to half.
  ///
  /// It uses forces, not energies, whose differences drown in rounding long before forces vanish.
  /// The projected force is close to piecewise linear, with a kink where a contact closes that may
  /// be ten orders of magnitude stiffer than before: two points beyond the kink determine it.
  Line search_along(const Vector &step, const LandscapeSums &from)
  {
    const double slope = from.gradient.dot(step);
    Bracket bracket(slope);
    double factor = by_newton ? reach : 1.0;
    for (int n = 1;; ++n) {
      Line line{factor * step, {}, factor};
      line.sums = evaluate(line.step);
      const bool refused = line.sums.is_refused();
      const double here = refused ? INFINITY : line.sums.gradient.dot(step);
      const bool is_good = std::abs(here) <= 0.9 * std::abs(slope) || (here < 0.0 && factor == 1.0);
      if (is_good || n >= (refused ? 2 * TRIES : TRIES)) {
        if (by_newton) reach = std::min(1.0, Bracket::WIDER * factor);
        return line;
      }
      factor = bracket.next(factor, here);
    }
  }
};

}  // namespace jamshape
