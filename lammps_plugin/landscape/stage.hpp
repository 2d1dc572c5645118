#pragma once

#include "landscape/local_energy_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <Eigen/Core>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace jamshape {

/// The equation of one stage of an implicit step: the displacement x from the base satisfies
///     drag (x - centre) + dU/dx = 0,
/// the minimum of U + (x - centre).drag (x - centre) / 2. Drag coefficients (n,) are divided by the
/// time step.
struct Stage {
  Eigen::VectorXd drag, centre;
  bool extended;  // whether extended precision is needed
};

/// Units of errors. A displacement that changes overlaps is measured by their change: in the energy
/// norm, over that of the present overlaps. One that slides along contacts is measured by the
/// second-order change of the overlaps: over the square root of overlap times size.
struct StageUnits {
  double force;   // of a typical bond
  double energy;  // twice the typical energy of the packing
  double length;  // sqrt(overlap size)
  double n_particles;

  /// Magnitude of a displacement (n,), from the force (n,) that causes it and the drag over the
  /// time step.
  template <class X, class F, class C>
  double size(const X &shift, const F &pull, const C &drag) const
  {
    const double work = shift.dot(pull - drag.cwiseProduct(shift));
    const double hard = std::sqrt(std::max(work, 0.0) / energy);
    return std::max(hard, shift.norm() / std::sqrt(n_particles) / length);
  }
};

/// Tolerance of the correction, in these units, and the limits of a particle's displacement and
/// rotation in one step.
struct StageLimits {
  double accuracy;
  StepBounds step;
};

/// Factors of the Hessian plus drag at a point, and the number of bonds there.
struct StageFactors {
  std::shared_ptr<Factors> factors;
  std::size_t n_bonds;
};

/// Result of a stage; for rejected guesses `sums` holds the reason.
struct StageEnd {
  Eigen::VectorXd x;
  LandscapeSums sums;
  StageFactors found;
  int evaluations, factorisations, directions;
  bool solved;
};

/// Solves a stage as a minimisation. Its gradient is smooth between the kinks where bonds open and
/// close, and Newton's full steps find the set of closed bonds at once (semismooth Newton: Qi &
/// Sun, Math. Program. 58, 353 (1993)), mostly in three or four evaluations. A step that a closing
/// bond reverses with a larger force ends where the bond closes; otherwise rods could slide back
/// and forth through each other's bonds forever. Where steps shrink fast, the same factors serve
/// several, since they cost several evaluations. If the solution lies on a kink, steps oscillate
/// across it: it is found by bisection and treated as a stiff valley, a BFGS update of the factors
/// (Lewis & Overton, Math. Program. 141, 135 (2013)). Stages that do not converge are given up
/// early: in half of the cases the time step was too long anyway.
class StageSolver {
 public:
  using Vector = Eigen::VectorXd;
  /// Gives the local energy model pairs, some of which hold at a displacement.
  using Renew = std::function<void(const Displacement &)>;

  StageSolver(LocalEnergyModel &landscape, const Stage &equation, const StageUnits &scales,
              const StageLimits &bounds, Renew renew) :
      about(landscape), stage(equation), units(scales), limits(bounds),
      renew_pairs(std::move(renew))
  {
  }

  /// Solves from a guess, or from another one if particles collide there; with the factors of an
  /// earlier, similar stage, if given.
  StageEnd solve(const Vector &guess, const Vector &other, StageFactors earlier)
  {
    known = std::move(earlier);
    Point at = begin(guess, other);
    Vector before = Vector::Zero(guess.size());
    for (; directions < DIRECTIONS && !at.sums.is_refused(); ++directions) {
      const Correction correction = correction_at(at);
      if (!known.factors || !correction.step.allFinite()) break;
      if (is_last(correction.size)) {
        at.x += correction.step;
        return end(std::move(at), true);
      }
      size_before = correction.size;
      const double part = about.part_within(correction.step.data(), limits.step);
      const Vector step = part * correction.step;
      Point tried = point(at.x + step);
      if (!tried.sums.is_refused()) {
        if (is_past_a_kink(at, tried, step, before, correction.size)) {
          tried = between(at, std::move(tried), limits.accuracy / correction.size);
        } else if (tried.gradient.dot(step) > -at.gradient.dot(step)) {
          tried = point(at.x + lowest(at, tried, step, part) * step);
          size_before = 0.0;
        }
      }
      if (tried.sums.crossing >= 0) break;
      at = std::move(tried);
      before = step;
    }
    return end(std::move(at), false);
  }

 private:
  /// A stage is given up after this many directions.
  static constexpr int DIRECTIONS = 10;

  /// Directions that suffice for smooth stages; later steps are checked for kinks.
  static constexpr int SMOOTH = 3;
  /// Fraction of the force along a step that has reversed if the step crossed a kink.
  static constexpr double OVERSHOT = 0.3;
  /// Tolerances within which such a step is near the solution.
  static constexpr double NEAR = 100.0;
  /// Cosine beyond which such a step is antiparallel to the one before.
  static constexpr double BACK = 0.95;

  /// Ratio of successive corrections below which factors serve once more.
  static constexpr double SHRUNK = 0.02;
  /// Tolerances within which a correction is the last if the next is expected within one.
  static constexpr double NEARLY = 10.0;

  /// A guess with a force above this multiple of the typical one has passed through a collision.
  static constexpr double COLLISION = 30.0;

  struct Point {
    Vector x;
    LandscapeSums sums;
    Vector gradient;  // of the minimised function
  };

  struct Correction {
    Vector step;
    double size;
  };

  struct Kink {
    Vector across, jump;
    double inverse;
  };

  LocalEnergyModel &about;
  const Stage &stage;
  const StageUnits &units;
  const StageLimits &limits;
  Renew renew_pairs;
  StageFactors known;
  std::vector<Kink> kinks;
  int evaluations = 0, factorisations = 0, directions = 0;
  double size_before = 0.0;  // of the last correction by these factors after a full step

  StageEnd end(Point at, bool solved) const
  {
    return {std::move(at.x), std::move(at.sums), known, evaluations,
            factorisations,  directions,         solved};
  }

  Point point(Vector x)
  {
    const Displacement at{x.data(), 0.0};
    if (!about.holds(at)) renew(at);
    ++evaluations;
    LandscapeSums sums = about.evaluate(at, stage.extended);
    Vector gradient = sums.gradient + stage.drag.cwiseProduct(x - stage.centre);
    return {std::move(x), std::move(sums), std::move(gradient)};
  }

  void renew(const Displacement &at)
  {
    renew_pairs(at);
    about.holds(at);
  }

  Point begin(const Vector &guess, const Vector &other)
  {
    Point first = point(guess);
    const bool collides = first.gradient.size() > 0 &&
                          !(first.gradient.cwiseAbs().maxCoeff() <= COLLISION * units.force);
    return first.sums.crossing >= 0 || collides ? point(other) : first;
  }

  /// The correction by the present factors, as long as they serve.
  Correction correction_at(const Point &at)
  {
    if (known.factors) {
      Correction found = newton(at);
      if (serve(at, found.size)) return found;
    }
    size_before = 0.0;
    known = {about.factorise({at.x.data(), 0.0}, stage.drag), at.sums.n_bonds};
    ++factorisations;
    return known.factors ? newton(at) : Correction{};
  }

  /// Factors of an earlier stage make the first step if the number of bonds is the same.
  bool serve(const Point &at, double size) const
  {
    if (directions == 0 && at.sums.n_bonds == known.n_bonds) return true;
    return size <= std::max(limits.accuracy, SHRUNK * size_before);
  }

  /// Newton's step, with BFGS updates for the kinks found.
  Correction newton(const Point &at) const
  {
    Vector q = -at.gradient;
    std::vector<double> weights(kinks.size());
    for (std::size_t k = kinks.size(); k-- > 0;) {
      weights[k] = kinks[k].inverse * kinks[k].across.dot(q);
      q -= weights[k] * kinks[k].jump;
    }
    q = known.factors->solve(q);
    for (std::size_t k = 0; k < kinks.size(); ++k) {
      q += (weights[k] - kinks[k].inverse * kinks[k].jump.dot(q)) * kinks[k].across;
    }
    const double size = units.size(q, -at.gradient, stage.drag);
    return {std::move(q), size};
  }

  /// Newton's method squares errors: with factors from the previous point, the error left by a
  /// correction is less than twice its square over the previous one.
  bool is_last(double size) const
  {
    const bool is_near = size <= NEARLY * limits.accuracy;
    return size <= limits.accuracy ||
           (is_near && 2.0 * size * size <= limits.accuracy * size_before);
  }

  /// The minimised function.
  double energy(const Point &at) const
  {
    const Vector by = at.x - stage.centre;
    return at.sums.energy + 0.5 * by.dot(stage.drag.cwiseProduct(by));
  }

  /// The fraction of a step that minimises the energy, assuming the slope of the factors, of which
  /// the step is a fraction, and from some point on also that of one closing bond: energies and
  /// slopes at both ends are matched.
  double lowest(const Point &at, const Point &tried, const Vector &step, double part) const
  {
    const double slope = -at.gradient.dot(step);
    const double force = tried.gradient.dot(step) / slope + 1.0 - part;
    const double work = (energy(tried) - energy(at)) / slope + 1.0 - 0.5 * part;
    const double closed = std::clamp(2.0 * work / force, 1e-3, 1.0);  // including that bond
    const double stiffness = force / closed;
    return (1.0 + stiffness * (1.0 - closed)) / (part + stiffness);
  }

  bool is_past_a_kink(const Point &at, const Point &tried, const Vector &step, const Vector &before,
                      double size) const
  {
    if (directions < SMOOTH) return false;
    const bool overshot = tried.gradient.dot(step) > -OVERSHOT * at.gradient.dot(step);
    const bool turns_round = step.dot(before) < -BACK * step.norm() * before.norm();
    return overshot && (size <= NEAR * limits.accuracy || turns_round);
  }

  /// Locates a kink by bisection, to a fraction of the distance between two points. The gradient
  /// there is the mean of those on its sides that does not push across: zero if the solution lies
  /// on it.
  Point between(Point low, Point high, double width)
  {
    const Vector way = high.x - low.x;
    for (int left = static_cast<int>(std::ceil(std::log2(1.0 / width))); left > 0; --left) {
      Point middle = point(0.5 * (low.x + high.x));
      if (middle.sums.is_refused()) return middle;
      (middle.gradient.dot(way) > 0.0 ? high : low) = std::move(middle);
    }
    Kink kink{high.x - low.x, high.gradient - low.gradient, 0.0};
    const double here = low.gradient.dot(kink.across), there = high.gradient.dot(kink.across);
    kink.inverse = 1.0 / (there - here);
    high.gradient = kink.inverse * (there * low.gradient - here * high.gradient);
    kinks.push_back(std::move(kink));
    return high;
  }
};

}  // namespace jamshape
