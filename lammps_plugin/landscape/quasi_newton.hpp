#pragma once

#include "landscape/block_factors.hpp"
#include "landscape/block_kernels.hpp"

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

  /// Directions that remember this many steps.
  explicit QuasiNewton(std::size_t most_steps) : most(most_steps) {}

  bool is_empty() const { return pairs.empty(); }

  /// Adds a step and the change of the gradient along it, both over the length of the step.
  void learn(const Vector &step, const Vector &change)
  {
    const double curvature = step.dot(change), length = step.norm();
    if (!(curvature > LEAST * length * change.norm())) return;
    Pair added;
    if (pairs.size() == most) {  // its arrays are used again
      added = std::move(pairs.front());
      pairs.pop_front();
    }
    added.step = ((1.0 / length) * step).cast<float>();
    added.change = ((1.0 / length) * change).cast<float>();
    added.inverse = length * length / curvature;
    pairs.push_back(std::move(added));
  }

  void forget() { pairs.clear(); }

  /// The direction from a gradient, starting from the inverse of a matrix near the Hessian.
  Vector direction(const Vector &gradient, const Factors &near) const
  {
    Vector q = -gradient;
    std::vector<double> weight(pairs.size());
    double product = pairs.empty() ? 0.0 : add(0.0, pairs.back().step, pairs.back().step, q);
    for (std::size_t k = pairs.size(); k-- > 0;) {
      weight[k] = pairs[k].inverse * product;
      product = add(-weight[k], pairs[k].change, pairs[k > 0 ? k - 1 : k].step, q);
    }
    q = near.solve(q);
    if (!pairs.empty()) product = add(0.0, pairs.front().change, pairs.front().change, q);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const std::size_t next = k + 1 < pairs.size() ? k + 1 : k;
      product = add(weight[k] - pairs[k].inverse * product, pairs[k].step, pairs[next].change, q);
    }
    return q;
  }

 private:
  static constexpr double LEAST = 1e-10;  // cosine: less is rounding

  struct Pair {
    Eigen::VectorXf step, change;
    double inverse;
  };
  std::size_t most;
  std::deque<Pair> pairs;
  AddAndDot add_and_dot_product = add_and_dot();

  /// Adds `by` times a vector to q, and returns the dot product of q and a further one.
  double add(double by, const Eigen::VectorXf &vector, const Eigen::VectorXf &further,
             Vector &q) const
  {
    return add_and_dot_product(static_cast<int>(q.size()), by, vector.data(), further.data(),
                               q.data());
  }
};

}  // namespace jamshape
