#pragma once

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
/// Optimization, Sec. 7.1).
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
    const Vector origin = Vector::Zero(static_cast<Eigen::Index>(about.n()));
    about.differentiate({origin.data(), 0.0}, Fill::COMPLETE);
    const double largest = about.n() > 0 ? about.diagonal().cwiseAbs().maxCoeff() : 0.0;
    if (!std::isfinite(largest))
      throw std::runtime_error("The Hessian has elements that are not finite.");
    scale = largest > 0.0 ? largest : 1.0;
    shift = std::max(shift, LEAST_SHIFT * scale);
    is_old = about.has_complete_factors() && factors && factors->size() == about.n() && !is_far;
    if (!is_old) factorise();
  }

  /// Solves to a relative accuracy, used by iterations only.
  Vector solve(const Vector &right, double accuracy)
  {
    if (about.has_complete_factors()) {
      if (is_old) factorise();
      return factors->solve(right);
    }
    while (true) {
      const Iterated found = iterate(right, accuracy * right.norm());
      if (found.is_solution) return found.x;
      shift *= GROWTH;
      factorise();
    }
  }

  /// A descent direction from a gradient: the solution, or a direction of negative curvature that
  /// the iterations met (Alg. 7.1 there).
  Vector direction(const Vector &gradient, double accuracy)
  {
    if (about.has_complete_factors()) {
      if (is_old) {
        const Iterated found = with_old_factors(gradient, accuracy);
        if (found.is_solution) return -found.x;
        factorise();
      }
      return -factors->solve(gradient);
    }
    return -iterate(gradient, accuracy * gradient.norm()).x;
  }

  /// A direction in which the negative curvature of the Hessian, as last prepared, exceeds this;
  /// nothing if there is none.
  std::optional<Vector> falling(double curvature)
  {
    const double before = std::exchange(shift, curvature);
    factorise();
    shift = curvature;  // the factors may have a larger shift
    const Iterated found = iterate(some_vector(), FALLING);
    shift = before;
    if (found.is_solution) return {};
    return found.last;
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

  /// Iterations with complete factors of an earlier base that take less time than new ones, and the
  /// remainder of the solution over the accuracy of other iterations.
  static constexpr int MOST_ITERATIONS = 10;
  static constexpr double REMAINDER = 0.1;

  /// Smallest shift of incomplete factors, over the largest diagonal element, if pivots need one.
  static constexpr double INCOMPLETE = 1e-4;

  LocalEnergyModel &about;
  double scale = 1.0;
  std::shared_ptr<Factors> factors;
  bool is_old = false, is_far = false;  // factors of an earlier base; too far from it

  void factorise()
  {
    is_old = is_far = false;
    const bool complete = about.has_complete_factors();
    double added = shift;
    while (!(factors = factors_with(added))) {
      added = complete ? GROWTH * added : std::max(GROWTH * added, INCOMPLETE * scale);
      if (!std::isfinite(added)) throw std::runtime_error("The Hessian cannot be factorised.");
    }
    if (complete) shift = added;
  }

  std::shared_ptr<Factors> factors_with(double added)
  {
    ++factorisations;
    return about.factors(Vector::Constant(static_cast<Eigen::Index>(about.n()), added));
  }

  struct Iterated {
    Vector x, last;  // x and the last direction
    bool is_solution;
  };

  /// A fixed unit vector with a component along every mode.
  Vector some_vector() const
  {
    std::mt19937_64 numbers(1);
    Vector found(static_cast<Eigen::Index>(about.n()));
    for (double &x : found) x = static_cast<double>(numbers() >> 11) * 0x1p-53 - 0.5;
    return found.normalized();
  }

  /// A solution by conjugate gradients preconditioned with complete factors of an earlier base,
  /// from which the matrix differs by the few contacts that have opened or closed. No solution if
  /// it differs too much; in the norm of the factors, as soft modes have small forces.
  Iterated with_old_factors(const Vector &right, double accuracy)
  {
    Vector x = Vector::Zero(right.size());
    Vector rest = right, preconditioned = factors->solve(rest), along = preconditioned;
    double product = rest.dot(preconditioned);
    const double enough = REMAINDER * REMAINDER * accuracy * accuracy * product;
    for (int k = 0; k < MOST_ITERATIONS; ++k) {
      const Vector pulled = about.times(along) + shift * along;
      ++products;
      const double curvature = along.dot(pulled);
      if (!(curvature > 0.0)) break;
      const double length = product / curvature;
      x += length * along;
      rest -= length * pulled;
      preconditioned = factors->solve(rest);
      const double next = rest.dot(preconditioned);
      if (next <= enough) {
        is_far = 2 * k > MOST_ITERATIONS;
        return {x, along, true};
      }
      along = preconditioned + (next / product) * along;
      product = next;
    }
    return {x, along, false};
  }

  /// Preconditioned conjugate gradients, which in exact arithmetic end after as many steps as there
  /// are coordinates; or stop where the matrix is not positive definite.
  Iterated iterate(const Vector &right, double remainder)
  {
    Vector x = Vector::Zero(right.size());
    Vector rest = right, preconditioned = factors->solve(rest), along = preconditioned;
    double product = rest.dot(preconditioned);
    for (Eigen::Index k = 0; k < right.size() && rest.norm() > remainder; ++k) {
      const Vector pulled = about.times(along) + shift * along;
      ++products;
      const double curvature = along.dot(pulled);
      if (!(curvature > 0.0)) return {k > 0 ? x : along, along, false};
      const double length = product / curvature;
      x += length * along;
      rest -= length * pulled;
      preconditioned = factors->solve(rest);
      const double next = rest.dot(preconditioned);
      along = preconditioned + (next / product) * along;
      product = next;
    }
    return {x, along, true};
  }
};

}  // namespace jamshape
