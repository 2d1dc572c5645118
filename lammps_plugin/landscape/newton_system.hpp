#pragma once

#include "landscape/conjugate_gradients.hpp"
#include "landscape/local_energy_model.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

namespace jamshape {

/// The equations of Newton's method at the base of a local energy model, (H + shift) x = right: the
/// shift, kept from one base to the next, makes the Hessian H positive definite. Solved by complete
/// factors where these are cheap, which serve as long as few contacts open or close, else by
/// conjugate gradients preconditioned with incomplete ones (Nocedal & Wright, Numerical
/// Optimization, Sec. 7.1), until these take longer than complete factors, as close to isostatic
/// packings.
class NewtonSystem {
 public:
  using Vector = Eigen::VectorXd;

  NewtonSystem(LocalEnergyModel &landscape, double first_shift) :
      shift(first_shift), about(landscape)
  {
  }

  double shift;
  int factorisations = 0, products = 0;

  /// Takes the Hessian at the base. Where it is factorised, raises the shift until all pivots are
  /// positive.
  void prepare()
  {
    differentiate(about.fill());
    const double largest = about.n() > 0 ? about.diagonal().cwiseAbs().maxCoeff() : 0.0;
    if (!std::isfinite(largest))
      throw std::runtime_error("The Hessian has elements that are not finite.");
    scale = largest > 0.0 ? largest : 1.0;
    shift = std::max(shift, LEAST_SHIFT * scale);
    incomplete = nullptr;
    is_old = complete && complete->size() == about.n() && !is_far;
    if (!is_old) complete = nullptr;
    if (!is_old && about.has_complete_factors()) factorise();
  }

  /// Solves to a relative accuracy, used by iterations only.
  Vector solve(const Vector &right, double accuracy)
  {
    while (!about.has_complete_factors()) {
      const Iterated found = with_incomplete_factors(right, accuracy, few());
      if (found.end == Solved::YES) return found.x;
      if (found.end == Solved::TOO_LONG) break;
      shift *= GROWTH;
      incomplete = nullptr;
    }
    if (is_old || !complete) factorise();
    return complete->solve(right);
  }

  /// A descent direction from a gradient: the solution, or a direction of negative curvature that
  /// the iterations met.
  Vector direction(const Vector &gradient, double accuracy)
  {
    if (is_old) {
      const Iterated found = with_old_factors(gradient, accuracy);
      if (found.end == Solved::YES) return -found.x;
      complete = nullptr;
    }
    if (about.has_complete_factors()) {
      if (!complete) factorise();
      return -complete->solve(gradient);
    }
    Iterated found = with_incomplete_factors(gradient, accuracy, few());
    if (found.end == Solved::TOO_LONG) {
      if (is_positive()) return -complete->solve(gradient);
      found = with_incomplete_factors(gradient, accuracy, gradient.size());
    }
    return -found.x;
  }

  /// A direction in which the negative curvature of the Hessian, as last prepared, exceeds this;
  /// nothing if there is none.
  std::optional<Vector> falling(double curvature)
  {
    const double before = std::exchange(shift, curvature);
    const bool can_factorise = has_memory();
    incomplete = nullptr;
    std::optional<Vector> found;
    if (!can_factorise || !is_positive()) {
      if (can_factorise) factorise();
      const Factors &near = can_factorise ? *complete : approximate();
      shift = curvature;  // the factors may have a larger one
      const Vector from = some_vector();
      const Iterated along = iterate(near, from, FALLING, from.size());
      if (along.end == Solved::FALLS) found = along.last;
    }
    shift = before;
    incomplete = nullptr;
    return found;
  }

  /// Lowers the shift after a step that was taken as a whole, raises it if a small part was.
  /// A contact that closed and stopped the step says nothing about the matrix: complete factors
  /// take it in next, at any shift; iterations take longer the lower the shift.
  void learn(double part, bool has_closed)
  {
    const bool is_right = part == 1.0 || (has_closed && about.has_complete_factors());
    if (is_right) {
      shift /= DECAY;
    } else if (part < FAR_OFF) {
      shift *= GROWTH;
    }
  }

 private:
  static constexpr double GROWTH = 10.0, DECAY = 3.0;

  /// Relative remainder of a unit vector after iterations that met no negative curvature.
  static constexpr double FALLING = 1e-3;

  /// A step of which the line search takes a smaller part had a wrong direction.
  static constexpr double FAR_OFF = 0x1p-6;

  /// Most iterations with complete factors of an earlier base: as many as take this part of the
  /// time of new ones, and at least this number. And the remainder of the solution over the
  /// accuracy of other iterations.
  static constexpr double PART_OF_PRICE = 0.4;
  static constexpr int MOST_ITERATIONS = 10;
  static constexpr double REMAINDER = 0.1;

  /// Smallest shift of incomplete factors, over the largest diagonal element, if pivots need one.
  static constexpr double INCOMPLETE = 1e-4;

  /// Iterations with incomplete factors, over the number of coordinates, after which complete ones
  /// are made. With more than MANY coordinates their memory grows too large.
  static constexpr double FEW = 0.04;
  static constexpr std::size_t MANY = 30000;

  LocalEnergyModel &about;
  double scale = 1.0;
  std::shared_ptr<Factors> complete, incomplete;
  bool is_old = false, is_far = false;  // complete factors of an earlier base; too far from it

  bool has_memory() const { return about.has_complete_factors() || about.n() <= MANY; }

  Eigen::Index few() const
  {
    const auto n = static_cast<Eigen::Index>(about.n());
    return has_memory() ? static_cast<Eigen::Index>(FEW * n) : n;
  }

  void differentiate(Fill fill)
  {
    const Vector origin = Vector::Zero(static_cast<Eigen::Index>(about.n()));
    about.differentiate({origin.data(), 0.0}, fill);
  }

  /// Whether the Hessian with its shift is positive definite; then it has complete factors.
  bool is_positive()
  {
    if (!about.has_complete_factors()) differentiate(Fill::COMPLETE);
    is_old = is_far = false;
    complete = factors_with(shift);
    return complete != nullptr;
  }

  /// Makes complete factors, and raises the shift until all pivots are positive.
  void factorise()
  {
    while (!is_positive()) raise(shift);
  }

  /// Factors near the Hessian, incomplete ones if these were prepared.
  const Factors &approximate()
  {
    for (double added = shift; !incomplete && !(incomplete = factors_with(added));) {
      raise(added);
      added = std::max(added, INCOMPLETE * scale);
    }
    return *incomplete;
  }

  static void raise(double &added)
  {
    added *= GROWTH;
    if (!std::isfinite(added)) throw std::runtime_error("The Hessian cannot be factorised.");
  }

  std::shared_ptr<Factors> factors_with(double added)
  {
    ++factorisations;
    return about.factors(Vector::Constant(static_cast<Eigen::Index>(about.n()), added));
  }

  /// A fixed unit vector with a component along every mode.
  Vector some_vector() const
  {
    std::mt19937_64 numbers(1);
    Vector found(static_cast<Eigen::Index>(about.n()));
    for (double &x : found) x = static_cast<double>(numbers() >> 11) * 0x1p-53 - 0.5;
    return found.normalized();
  }

  /// A solution by iterations with complete factors of an earlier base, from which the matrix
  /// differs by the few contacts that have opened or closed. None if it differs too much; in the
  /// norm of the factors, as soft modes have small forces.
  Iterated with_old_factors(const Vector &right, double accuracy)
  {
    const double enough = REMAINDER * accuracy;
    const int most = std::max(MOST_ITERATIONS, static_cast<int>(PART_OF_PRICE * complete->price()));
    const Iterated found = iterated(*complete, right, most, [&](const Vector &, double part) {
      return !(part > enough * enough);
    });
    is_far = 2 * (found.n - 1) > most;
    return found;
  }

  Iterated with_incomplete_factors(const Vector &right, double accuracy, Eigen::Index most)
  {
    return iterate(approximate(), right, accuracy * right.norm(), most);
  }

  Iterated iterate(const Factors &near, const Vector &right, double remainder, Eigen::Index most)
  {
    return iterated(near, right, most,
                    [&](const Vector &rest, double) { return rest.norm() <= remainder; });
  }

  template <class IsDone>
  Iterated iterated(const Factors &near, const Vector &right, Eigen::Index most,
                    const IsDone &is_done)
  {
    const auto times = [&](const Vector &along) -> Vector {
      return about.times(along) + shift * along;
    };
    const auto solve_nearly = [&](const Vector &rest) { return near.solve_nearly(rest); };
    Iterated found = conjugate_gradients(right, most, times, solve_nearly, is_done);
    products += static_cast<int>(found.n);
    return found;
  }
};

}  // namespace jamshape
