#pragma once

#include <cstddef>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <utility>

namespace jamshape {

/// The smallest shift of a diagonal, over its largest element: rounding in the factorisation is
/// just below it, and so is what it does to modes that are stiff at all.
inline constexpr double LEAST_SHIFT = 1e-13;

/// The upper triangle of a sparse symmetric matrix, column by column.
using UpperTriangle = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

/// Where each row goes.
using Order = Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int>;

/// An order of rows in which factors stay sparse (approximate minimum degree).
template <class Matrix> Order sparse_order(const Matrix &symmetric)
{
  Order inverse;
  Eigen::AMDOrdering<int>()(symmetric.template selfadjointView<Eigen::Upper>(), inverse);
  return inverse.inverse();
}

/// Factors L D L^T of sparse symmetric matrices of one pattern. Without pivoting, so that the signs
/// of D are those of the eigenvalues (Sylvester's law of inertia).
class SymmetricFactors {
 public:
  /// Of matrices whose rows are in this order already; vectors come as they were before.
  SymmetricFactors(const UpperTriangle &pattern, Order rows) : order(std::move(rows))
  {
    factors.analyzePattern(pattern);
  }

  /// False if a pivot is zero.
  bool factorise(const UpperTriangle &matrix)
  {
    factors.factorize(matrix);
    return factors.info() == Eigen::Success;
  }

  /// Pivots that are negative, or no number.
  std::size_t n_negative() const
  {
    const auto pivots = factors.vectorD();
    return static_cast<std::size_t>((!(pivots.array() > 0.0)).count());
  }

  std::size_t size() const { return static_cast<std::size_t>(factors.rows()); }

  Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const
  {
    const Eigen::VectorXd ordered = order * right, found = factors.solve(ordered);
    return order.inverse() * found;
  }

 private:
  Order order;
  Eigen::SimplicialLDLT<UpperTriangle, Eigen::Upper, Eigen::NaturalOrdering<int>> factors;
};

}  // namespace jamshape
