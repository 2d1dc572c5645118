#pragma once

#include "landscape/block_factors.hpp"
#include "landscape/history_kernels.hpp"

#include <cstddef>
#include <deque>
#include <Eigen/Core>
#include <utility>
#include <vector>

namespace jamshape {

/// Directions of the limited-memory BFGS method (Nocedal & Wright, Numerical Optimization,
/// Alg. 7.4). Steps are remembered to eight bits, and directions computed in single precision: a
/// step of a minimisation takes less time.
class QuasiNewton {
 public:
  using Vector = Eigen::VectorXd;

  /// Directions that remember this many steps.
  explicit QuasiNewton(std::size_t most_steps) : most(most_steps) {}

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
    shorten(step, 1.0 / length, added.step);
    shorten(change, 1.0 / length, added.change);
    // Of the rounded vectors: with that of exact ones, directions would not belong to a positive
    // definite matrix.
    const double of_rounded =
        kernels.dot(static_cast<int>(added.step.size()), added.step.data(), added.change.data());
    if (!(of_rounded > 0.0)) return;
    added.inverse = 1.0 / of_rounded;
    pairs.push_back(std::move(added));
  }

  void forget() { pairs.clear(); }

  /// The direction from a gradient, starting from the inverse of a matrix near the Hessian.
  Vector direction(const Vector &gradient, const Factors &near) const
  {
    if (pairs.empty()) return -near.solve(gradient);
    const double scale = gradient.cwiseAbs().maxCoeff();  // may be tiny for single precision
    Floats q = Floats::Zero(padded(gradient.size()));
    auto own = q.head(gradient.size());
    own = (-1.0 / scale * gradient).cast<float>();
    std::vector<double> weight(pairs.size());
    double product = add(0.0, pairs.back().step, pairs.back().step, q);
    for (std::size_t k = pairs.size(); k-- > 0;) {
      weight[k] = pairs[k].inverse * product;
      product = add(-weight[k], pairs[k].change, pairs[k > 0 ? k - 1 : k].step, q);
    }
    own = near.solve(own.cast<double>()).cast<float>();
    product = add(0.0, pairs.front().change, pairs.front().change, q);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const std::size_t next = k + 1 < pairs.size() ? k + 1 : k;
      product = add(weight[k] - pairs[k].inverse * product, pairs[k].step, pairs[next].change, q);
    }
    return scale * own.cast<double>();
  }

 private:
  static constexpr double LEAST = 1e-10;  // cosine: less is rounding

  using Floats = Eigen::VectorXf;
  using Short = std::vector<FirstHalf>;  // followed by zeros, as long as `padded`

  struct Pair {
    Short step, change;
    double inverse;
  };
  std::size_t most;
  std::deque<Pair> pairs;
  HistoryKernels kernels = history_kernels();

  static Eigen::Index padded(Eigen::Index n)
  {
    constexpr int AT_ONCE = HistoryKernels::AT_ONCE;
    return (n + AT_ONCE - 1) / AT_ONCE * AT_ONCE;
  }

  void shorten(const Vector &vector, double by, Short &to) const
  {
    to.resize(static_cast<std::size_t>(padded(vector.size())));
    kernels.shorten(static_cast<int>(vector.size()), by, vector.data(), to.data());
  }

  /// Adds `by` times a vector to q, and returns the dot product of q and a further one.
  double add(double by, const Short &vector, const Short &further, Floats &q) const
  {
    return kernels.add_and_dot(static_cast<int>(q.size()), static_cast<float>(by), vector.data(),
                               further.data(), q.data());
  }
};

}  // namespace jamshape
