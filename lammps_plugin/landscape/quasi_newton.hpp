#pragma once

#include "landscape/block_factors.hpp"

#include <cstddef>
#include <deque>
#include <Eigen/Core>
#include <utility>
#include <vector>

namespace jamshape {

/// Directions of the limited-memory BFGS method (Nocedal & Wright, Numerical Optimization,
/// Alg. 7.4).
class QuasiNewton {
 public:
  using Vector = Eigen::VectorXd;

  bool is_empty() const { return pairs.empty(); }

  /// Adds a step and the change of the gradient along it.
  void learn(Vector step, Vector change)
  {
    const double curvature = step.dot(change);
    if (!(curvature > LEAST * step.norm() * change.norm())) return;
    if (pairs.size() == MEMORY) pairs.pop_front();
    pairs.push_back({std::move(step), std::move(change), 1.0 / curvature});
  }

  void forget() { pairs.clear(); }

  /// The direction from a gradient, starting from the inverse of a matrix near the Hessian.
  Vector direction(const Vector &gradient, const Factors &near) const
  {
    Vector q = -gradient;
    std::vector<double> weight(pairs.size());
    for (std::size_t k = pairs.size(); k-- > 0;) {
      weight[k] = pairs[k].inverse * pairs[k].step.dot(q);
      q -= weight[k] * pairs[k].change;
    }
    q = near.solve(q);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      q += (weight[k] - pairs[k].inverse * pairs[k].change.dot(q)) * pairs[k].step;
    }
    return q;
  }

 private:
  static constexpr std::size_t MEMORY = 20;
  static constexpr double LEAST = 1e-10;  // cosine: less is rounding

  struct Pair {
    Vector step, change;
    double inverse;
  };
  std::deque<Pair> pairs;
};

}  // namespace jamshape
