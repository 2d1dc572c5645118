#pragma once

#include "landscape/block_factors.hpp"
#include "landscape/conjugate_gradients.hpp"
#include "landscape/elimination_order.hpp"
#include "landscape/supernode_factors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

namespace jamshape {

/// The Hessian of the energies of pairs, block by block, and its factors.
class BlockSystem {
 public:
  virtual ~BlockSystem() = default;
  virtual void clear() = 0;
  /// Whether a pair can be added.
  virtual bool couples(std::size_t pair) const = 0;
  /// Adds the second derivatives of a pair with respect to the coordinates of its first and its
  /// second particle, a square matrix in columns.
  virtual void add(std::size_t pair, const double *by) = 0;
  /// Adds those with respect to the displacement of the first particle relative to the second,
  /// (D, D), of a pair without rotations.
  virtual void add_shifts(std::size_t pair, const double *by) = 0;
  virtual Eigen::VectorXd diagonal() const = 0;
  virtual Eigen::VectorXd times(const Eigen::Ref<const Eigen::VectorXd> &vector) const = 0;
  /// Factors of the matrix plus a diagonal (n,); null if a pivot is not positive.
  virtual std::shared_ptr<Factors> factors(const Eigen::VectorXd &added) = 0;
  /// The same with solutions by iteration, to a small residual, if factors are incomplete.
  virtual std::shared_ptr<Factors> iterated(const Eigen::VectorXd &added) = 0;
};

/// Layout of a block system: the numbers (N + 1,) of the first coordinates of particles with at
/// most `most` each, and pairs of them (M, 2), of which only those are added that are `used` (M,).
/// `position` (N, D) is where the particles are in their box, if fill-in is complete.
struct BlockPlan {
  const std::vector<std::int64_t> &coordinate;
  const std::vector<std::int64_t> &pairs;
  const std::vector<char> &used;
  int most;
  Fill fill;
  std::vector<double> position;
};

/// A matrix whose equations are solved by conjugate gradients, preconditioned with incomplete
/// factors. Where it is not positive definite, a solution ends at the direction that shows it.
template <int BLOCK> class IteratedFactors : public Factors {
 public:
  IteratedFactors(std::shared_ptr<const BlockPattern> of, const BlockKernels &compiled,
                  BlockMatrix<BLOCK> of_equations, std::shared_ptr<const Factors> nearly) :
      pattern(std::move(of)), kernels(compiled), matrix(std::move(of_equations)),
      near(std::move(nearly))
  {
  }

  std::size_t size() const override { return pattern->n(); }
  double price() const override { return 1.0; }

  Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const override
  {
    const auto times = [&](const Eigen::VectorXd &along) {
      BlockRows<BLOCK> from(*pattern, along), to(*pattern);
      kernels.multiply(matrix.view(*pattern), from.data(), to.data());
      return to.gathered();
    };
    const auto solve_nearly = [&](const Eigen::VectorXd &rest) { return near->solve(rest); };
    const auto is_done = [](const Eigen::VectorXd &, double part) {
      return !(part > REMAINDER * REMAINDER);
    };
    return conjugate_gradients(right, right.size(), times, solve_nearly, is_done).x;
  }

 private:
  /// Relative residual, in the norm of the preconditioner: Newton's method corrects the remaining
  /// error.
  static constexpr double REMAINDER = 1e-5;

  std::shared_ptr<const BlockPattern> pattern;
  BlockKernels kernels;
  BlockMatrix<BLOCK> matrix;
  std::shared_ptr<const Factors> near;
};

/// Block system of particles with only their first BLOCK coordinates.
template <int BLOCK, int D> class BlockSystemOf : public BlockSystem {
 public:
  explicit BlockSystemOf(const BlockPlan &plan) : most(plan.most), pairs(plan.pairs)
  {
    std::vector<std::int64_t> coupled;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if (plan.used[k / 2]) coupled.push_back(pairs[k]);
    }
    pattern =
        std::make_shared<BlockPattern>(plan.coordinate, coupled, ordered(plan, coupled), plan.fill);
    for (std::size_t p = 0; p < pairs.size() / 2; ++p) {
      const int i = place(p, 0), j = place(p, 1);
      block.push_back(plan.used[p] ? pattern->find(std::min(i, j), std::max(i, j)) : -1);
    }
  }

  /// Sets the matrix to zero, with 1 for each coordinate that a particle does not have.
  void clear() override
  {
    hessian.diagonal.assign(pattern->size(), Block::Zero());
    hessian.below.assign(pattern->own_row.size(), Block::Zero());
    for (std::size_t i = 0; i < pattern->size(); ++i) {
      Block &own = hessian.diagonal[pattern->place[i]];
      for (int k = pattern->count(i); k < BLOCK; ++k) own(k, k) = 1.0;
    }
  }

  bool couples(std::size_t p) const override { return block[p] >= 0; }

  void add(std::size_t p, const double *by) override
  {
    const Eigen::Map<const Eigen::MatrixXd> all(by, 2 * most, 2 * most);
    const auto part = [&](int rows, int columns) {
      return all.template block<BLOCK, BLOCK>(rows * most, columns * most);
    };
    const int i = place(p, 0), j = place(p, 1);
    hessian.diagonal[i] += part(0, 0);
    hessian.diagonal[j] += part(1, 1);
    if (i == j) {  // a particle and its own image
      hessian.diagonal[i] += part(0, 1) + part(1, 0);
    } else {
      hessian.below[block[p]] += i > j ? part(0, 1) : part(1, 0);
    }
  }

  void add_shifts(std::size_t p, const double *by) override
  {
    const Eigen::Map<const Eigen::Matrix<double, D, D>> own(by);
    const int i = place(p, 0), j = place(p, 1);
    if (i == j) return;  // a particle and its own image move together
    hessian.diagonal[i].template topLeftCorner<D, D>() += own;
    hessian.diagonal[j].template topLeftCorner<D, D>() += own;
    hessian.below[block[p]].template topLeftCorner<D, D>() -= own;
  }

  Eigen::VectorXd diagonal() const override
  {
    Eigen::VectorXd found(static_cast<Eigen::Index>(pattern->n()));
    for (std::size_t i = 0; i < pattern->size(); ++i) {
      const Block &own = hessian.diagonal[pattern->place[i]];
      for (int k = 0; k < pattern->count(i); ++k) found[pattern->coordinate[i] + k] = own(k, k);
    }
    return found;
  }

  Eigen::VectorXd times(const Eigen::Ref<const Eigen::VectorXd> &vector) const override
  {
    BlockRows<BLOCK> x(*pattern, vector), y(*pattern);
    kernels.multiply(hessian.view(*pattern), x.data(), y.data());
    return y.gathered();
  }

  std::shared_ptr<Factors> factors(const Eigen::VectorXd &added) override
  {
    const BlockRows<BLOCK> rows(*pattern, added);
    const std::shared_ptr<Elimination<BLOCK>> found = spare();
    return found->factorise(hessian, rows) ? found : nullptr;
  }

  std::shared_ptr<Factors> iterated(const Eigen::VectorXd &added) override
  {
    BlockMatrix<BLOCK> matrix{hessian.diagonal_plus(BlockRows<BLOCK>(*pattern, added)),
                              hessian.below};
    const double largest = (diagonal() + added).cwiseAbs().maxCoeff();
    const std::shared_ptr<Elimination<BLOCK>> near = spare();
    // The preconditioner alone is shifted where its pivots need it.
    for (double shift = 0.0; std::isfinite(shift);
         shift = std::max(10.0 * shift, INCOMPLETE * largest)) {
      const Eigen::VectorXd shifts =
          Eigen::VectorXd::Constant(static_cast<Eigen::Index>(pattern->n()), shift);
      if (near->factorise(matrix, BlockRows<BLOCK>(*pattern, shifts))) {
        return std::make_shared<IteratedFactors<BLOCK>>(pattern, kernels, std::move(matrix), near);
      }
    }
    return nullptr;
  }

 private:
  /// Smallest shift of incomplete factors, over the largest diagonal element, if pivots need one.
  static constexpr double INCOMPLETE = 1e-4;

  using Block = BlockOf<BLOCK>;
  int most;
  std::vector<std::int64_t> pairs;
  std::shared_ptr<const BlockPattern> pattern;
  std::vector<int> block;  // (M,) block of each used pair below the diagonal
  BlockMatrix<BLOCK> hessian;
  std::shared_ptr<const SupernodePattern> supernodes;
  std::vector<std::shared_ptr<Elimination<BLOCK>>> made;
  BlockKernels kernels = block_kernels<BLOCK>();

  /// Places of the particles in the order of elimination: with little fill-in, if there will be
  /// any.
  static std::vector<int> ordered(const BlockPlan &plan, const std::vector<std::int64_t> &coupled)
  {
    if (plan.fill == Fill::COMPLETE) return elimination_order<D>(plan.position, coupled);
    std::vector<int> as_they_are(plan.coordinate.size() - 1);
    std::iota(as_they_are.begin(), as_they_are.end(), 0);
    return as_they_are;
  }

  /// Row of a pair's first or second particle.
  int place(std::size_t p, int side) const { return pattern->place[pairs[2 * p + side]]; }

  /// Factors in use nowhere else.
  std::shared_ptr<Elimination<BLOCK>> spare()
  {
    for (const auto &one : made) {
      if (one.use_count() == 1) return one;
    }
    made.push_back(new_factors());
    return made.back();
  }

  /// Supernodes are narrow in a plane: factors block by block take less time there.
  std::shared_ptr<Elimination<BLOCK>> new_factors()
  {
    if constexpr (D == 3) {
      if (pattern->fill == Fill::COMPLETE) {
        if (!supernodes) supernodes = std::make_shared<SupernodePattern>(*pattern, BLOCK);
        return std::make_shared<SupernodeFactors<BLOCK>>(pattern, supernodes);
      }
    }
    return std::make_shared<BlockFactors<BLOCK>>(pattern, kernels);
  }
};

}  // namespace jamshape
