#pragma once

#include "landscape/local_energy_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <Eigen/Core>
#include <functional>
#include <iterator>
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

  /// Stiffness of a bond, at least.
  double stiffness() const { return force * force * n_particles / energy; }

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

/// Factors of the Hessian plus drag at a point, the number of bonds there, and the kinks on which
/// the state was held.
struct StageFactors {
  std::shared_ptr<Factors> factors;
  std::size_t n_bonds;
  std::vector<Kink> kinks{};
};

/// Result of a stage; for rejected guesses `sums` holds the reason.
struct StageEnd {
  Eigen::VectorXd x;
  LandscapeSums sums;
  StageFactors found;
  int evaluations, factorisations, directions;
  bool solved;
};

/// Turns a gradient (n,) into that of the mixtures on kinks, which are seen from the same point.
inline void mix(const std::vector<Kink> &kinks, const std::vector<KinkThere> &there,
                Eigen::VectorXd &gradient)
{
  for (std::size_t k = 0; k < kinks.size(); ++k) {
    there[k].add(1.0, there[k].change, gradient);
    there[k].add(kinks[k].weight, there[k].jump, gradient);
  }
}

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

  StageSolver(LocalEnergyModel &landscape, const Stage &equation, const StageUnits &scales,
              const StageLimits &bounds) :
      about(landscape), stage(equation), units(scales), limits(bounds)
  {
  }

  /// Solves from a guess, or from another one if particles collide there; with the factors of an
  /// earlier, similar stage, if given.
  StageEnd solve(const Vector &guess, const Vector &other, StageFactors earlier)
  {
    known = std::move(earlier);
    held = known.kinks;
    Point at = begin(guess, other);
    see_kinks(at);
    Vector before = Vector::Zero(guess.size());
    for (double first = 0.0; directions < most() && !at.sums.is_refused(); ++directions) {
      const Correction correction = correction_at(at);
      if (!known.factors || !correction.step.allFinite()) break;
      if (is_last(correction.size)) {
        move_weights(correction, 1.0);
        at.x += correction.step;
        return end(std::move(at), true);
      }
      if (directions == 0) first = correction.size;
      if (directions >= PATIENCE && correction.size > first) break;
      size_before = correction.size;
      const double part = about.part_within(correction.step.data(), limits.step);
      const Vector step = part * correction.step;
      Point tried = point(at.x + step);
      const double reversed = reversal(at, tried, step, part);
      move_weights(correction, part);
      const double down = pushed(at).dot(step);
      if (!tried.sums.is_refused()) {
        const bool again = see_kinks(tried);
        if (find_kinks(at, tried)) {
          size_before = 0.0;
        } else if (is_past_a_kink(at, tried, step, before, correction.size)) {
          tried = between(at, std::move(tried), limits.accuracy / correction.size);
        } else if (const double up = pushed(tried).dot(step); up > -down) {
          // The stiffness across a kink that holds the state again would hide the closing bond.
          const double shorter = reversed > 0.0 && !again ? reversed : down / (down - up);
          tried = point(at.x + shorter * step);
          see_kinks(tried);
          size_before = 0.0;
        }
      }
      if (tried.sums.crosses()) break;
      at = std::move(tried);
      before = step;
    }
    return end(std::move(at), false);
  }

 private:
  /// A stage is given up after this many directions.
  static constexpr int DIRECTIONS = 10;
  /// After this many, also if a correction exceeds the first one.
  static constexpr int PATIENCE = 5;

  /// Directions that suffice for smooth stages; later steps are checked for kinks.
  static constexpr int SMOOTH = 3;
  /// Kinks are released in this many turns.
  static constexpr int RELEASES = 4;
  /// Smallest jump of the slope on a kink, over a typical force.
  static constexpr double LEAST_JUMP = 1e-9;
  /// Stiffness across a kink, over that of a bond.
  static constexpr double STIFF = 1e5;
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
    Vector gradient;                 // of the minimised function
    std::vector<KinkThere> kinks{};  // those held and released
  };

  struct Correction {
    Vector step;
    double size;
    std::vector<double> weights{};  // changes of those of the kinks
  };

  struct Valley {
    Vector across, jump;
    double inverse;
  };

  LocalEnergyModel &about;
  const Stage &stage;
  const StageUnits &units;
  const StageLimits &limits;
  StageFactors known;
  std::vector<Valley> valleys;
  std::vector<Kink> held;  // on which the state is held, or from which it was released to a side
  int evaluations = 0, factorisations = 0, directions = 0;
  double size_before = 0.0;  // of the last correction by these factors after a full step

  /// Most directions: the kinks are known only after some.
  int most() const { return held.empty() ? DIRECTIONS : 2 * DIRECTIONS; }

  StageEnd end(Point at, bool solved)
  {
    known.kinks = kinks_held();
    return {std::move(at.x), std::move(at.sums), known, evaluations,
            factorisations,  directions,         solved};
  }

  Point point(Vector x)
  {
    const Displacement at{x.data(), 0.0};
    about.renew_pairs(at);
    ++evaluations;
    LandscapeSums sums = about.evaluate(at, {stage.extended, true});
    Vector gradient = sums.gradient + stage.drag.cwiseProduct(x - stage.centre);
    return {std::move(x), std::move(sums), std::move(gradient)};
  }

  Point begin(const Vector &guess, const Vector &other)
  {
    Point first = point(guess);
    const bool collides = first.gradient.size() > 0 &&
                          !(first.gradient.cwiseAbs().maxCoeff() <= COLLISION * units.force);
    return first.sums.crosses() || collides ? point(other) : first;
  }

  /// The correction by the present factors, as long as they serve. Kinks that it would leave are
  /// released, and the others corrected once more.
  Correction correction_at(const Point &at)
  {
    if (known.factors && hold_those_of_factors()) {
      Correction found = newton(at);
      if (serve(at, found.size) && !release(found)) return found;
    }
    for (int left = RELEASES; left >= 0; --left) {
      Correction found = factorised(at);
      if (!known.factors || !release(found) || left == 0) return found;
    }
    return {};
  }

  Correction factorised(const Point &at)
  {
    size_before = 0.0;
    each_held([&](std::size_t k) { held[k].stiffness = stiffness_across(at.kinks[k]); });
    std::vector<Kink> kinks = kinks_held();
    about.hold_kinks(kinks);
    known = {about.factorise({at.x.data(), 0.0}, stage.drag), at.sums.n_bonds, std::move(kinks)};
    about.hold_kinks({});
    ++factorisations;
    return known.factors ? newton(at) : Correction{};
  }

  /// Whether the factors are those of the kinks on which the state is held now.
  bool hold_those_of_factors() const
  {
    std::size_t k = 0;
    for (const Kink &kink : held) {
      if (!kink.is_held) continue;
      if (k == known.kinks.size()) return false;
      const Kink &other = known.kinks[k++];
      if (kink.pair != other.pair || kink.from != other.from || kink.to != other.to) return false;
    }
    return k == known.kinks.size();
  }

  /// Newton's step on the kinks, with the change of their weights: the solution of
  ///     (H + drag) q + sum of dw J = -slope,   J.q - dw / stiffness = -gap,
  /// J the jump across each kink (a proximal method of multipliers: Rockafellar, Math. Oper. Res.
  /// 1, 97 (1976)). The factors include stiffness J J^T, as sparse as H, since a kink is of one
  /// pair.
  Correction newton_on_kinks(const Point &at) const
  {
    Vector pull = -slope(at);
    Correction found{known.factors->solve(-pushed(at)), 0.0, std::vector<double>(held.size())};
    each_held([&](std::size_t k) {
      const KinkThere &there = at.kinks[k];
      found.weights[k] = held[k].stiffness * (there.gap + there.across(found.step));
      there.add(-found.weights[k], there.jump, pull);
    });
    found.size = units.size(found.step, pull, stage.drag);
    return found;
  }

  std::vector<Kink> kinks_held() const
  {
    std::vector<Kink> kinks;
    std::copy_if(held.begin(), held.end(), std::back_inserter(kinks),
                 [](const Kink &kink) { return kink.is_held; });
    return kinks;
  }

  double stiffness_across(const KinkThere &kink) const
  {
    const double least = LEAST_JUMP * units.force;
    return STIFF * units.stiffness() / std::max(kink.jump_squared(), least * least);
  }

  template <class Then> void each_held(const Then &then) const
  {
    for (std::size_t k = 0; k < held.size(); ++k) {
      if (held[k].is_held) then(k);
    }
  }

  /// The gradient at a point with the mixtures on kinks.
  Vector slope(const Point &at) const
  {
    Vector found = at.gradient;
    mix(held, at.kinks, found);
    return found;
  }

  /// Residual of Newton's step, with the pull onto the kinks.
  Vector pushed(const Point &at) const
  {
    Vector found = slope(at);
    each_held([&](std::size_t k) {
      at.kinks[k].add(held[k].stiffness * at.kinks[k].gap, at.kinks[k].jump, found);
    });
    return found;
  }

  void move_weights(const Correction &by, double part)
  {
    each_held([&](std::size_t k) { held[k].weight += part * by.weights[k]; });
  }

  /// Releases kinks to whose sides a correction leads; whether there are any.
  bool release(const Correction &by)
  {
    bool any = false;
    for (std::size_t k = 0; k < held.size(); ++k) {
      if (!held[k].is_held) continue;
      const double weight = held[k].weight + by.weights[k];
      if (weight >= 0.0 && weight <= 1.0) continue;
      held[k].weight = weight < 0.0 ? 0.0 : 1.0;
      held[k].is_held = false;
      any = true;
    }
    return any;
  }

  /// Looks at the kinks from a point, and holds those that it is on the wrong side of; whether
  /// there are any.
  bool see_kinks(Point &at)
  {
    bool again = false;
    if (held.empty() || at.sums.is_refused()) return again;
    at.kinks = about.kinks_at({at.x.data(), 0.0}, held, stage.extended);
    std::size_t kept = 0;
    for (std::size_t k = 0; k < held.size(); ++k) {
      const KinkThere &there = at.kinks[k];
      if (!there.exists) continue;
      if (!held[k].is_held && (held[k].weight < 0.5 ? there.gap > 0.0 : there.gap < 0.0))
        held[k].is_held = again = true;
      held[kept] = held[k];
      at.kinks[kept++] = there;
    }
    held.resize(kept);
    at.kinks.resize(kept);
    return again;
  }

  /// Holds the kinks that lie between two points; whether there are new ones.
  bool find_kinks(const Point &at, Point &tried)
  {
    if (!about.has_kinks() || directions < SMOOTH) return false;
    const auto before = about.pieces({at.x.data(), 0.0}), now = about.pieces({tried.x.data(), 0.0});
    std::vector<Kink> found;
    for (const auto &[pair, piece] : now) {
      const auto then = before.find(pair);
      if (then == before.end() || then->second == piece) continue;
      const auto is_same = [&name = pair](const Kink &kink) { return kink.pair == name; };
      if (std::any_of(held.begin(), held.end(), is_same)) continue;
      found.push_back({pair, then->second, piece, 0.5, 0.0, true});
    }
    const std::vector<KinkThere> there =
        about.kinks_at({tried.x.data(), 0.0}, found, stage.extended);
    bool any = false;
    for (std::size_t k = 0; k < found.size(); ++k) {
      // Only the larger of two pieces holds a state, and only where the slope jumps.
      const double jump = there[k].exists ? std::sqrt(there[k].jump_squared()) : 0.0;
      if (!(jump > LEAST_JUMP * units.force) || there[k].gap < 0.0) continue;
      held.push_back(found[k]);
      tried.kinks.push_back(there[k]);
      any = true;
    }
    return any;
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
    if (!held.empty()) return newton_on_kinks(at);
    Vector q = -at.gradient;
    std::vector<double> weights(valleys.size());
    for (std::size_t k = valleys.size(); k-- > 0;) {
      weights[k] = valleys[k].inverse * valleys[k].across.dot(q);
      q -= weights[k] * valleys[k].jump;
    }
    q = known.factors->solve(q);
    for (std::size_t k = 0; k < valleys.size(); ++k) {
      q += (weights[k] - valleys[k].inverse * valleys[k].jump.dot(q)) * valleys[k].across;
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

  /// The minimised function; near kinks that of the first of both pieces, with the weight of their
  /// difference and, where the state is held, the stiffness across: its gradient is `pushed`.
  double energy(const Point &at) const
  {
    const Vector by = at.x - stage.centre;
    double sum = at.sums.energy + 0.5 * by.dot(stage.drag.cwiseProduct(by));
    for (std::size_t k = 0; k < held.size(); ++k) {
      const double gap = at.kinks[k].gap;
      sum += held[k].weight * gap - std::max(gap, 0.0);
      if (held[k].is_held) sum += 0.5 * held[k].stiffness * gap * gap;
    }
    return sum;
  }

  /// The fraction of a step that minimises the energy at the weights before the step, if the force
  /// along it reverses and grows; else 0.
  double reversal(const Point &at, Point &tried, const Vector &step, double part) const
  {
    if (tried.sums.is_refused()) return 0.0;
    if (!held.empty()) tried.kinks = about.kinks_at({tried.x.data(), 0.0}, held, stage.extended);
    const bool reverses = pushed(tried).dot(step) > -pushed(at).dot(step);
    return reverses ? lowest(at, tried, step, part) : 0.0;
  }

  /// The fraction of a step that minimises the energy, assuming the slope of the factors, of which
  /// the step is a fraction, and from some point on also that of one closing bond: energies and
  /// slopes at both ends are matched.
  double lowest(const Point &at, const Point &tried, const Vector &step, double part) const
  {
    const double slope = -pushed(at).dot(step);
    const double force = pushed(tried).dot(step) / slope + 1.0 - part;
    const double work = (energy(tried) - energy(at)) / slope + 1.0 - 0.5 * part;
    const double closed = std::clamp(2.0 * work / force, 1e-3, 1.0);  // including that bond
    const double stiffness = force / closed;
    return (1.0 + stiffness * (1.0 - closed)) / (part + stiffness);
  }

  bool is_past_a_kink(const Point &at, const Point &tried, const Vector &step, const Vector &before,
                      double size) const
  {
    if (directions < SMOOTH || about.has_kinks()) return false;
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
    Valley valley{high.x - low.x, high.gradient - low.gradient, 0.0};
    const double here = low.gradient.dot(valley.across), there = high.gradient.dot(valley.across);
    valley.inverse = 1.0 / (there - here);
    high.gradient = valley.inverse * (there * low.gradient - here * high.gradient);
    valleys.push_back(std::move(valley));
    return high;
  }
};

}  // namespace jamshape
