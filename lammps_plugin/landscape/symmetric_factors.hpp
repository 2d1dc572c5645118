#pragma once

#include <cstddef>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace jamshape {

/// The lower triangle of a sparse symmetric matrix, column by column.
using LowerTriangle = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

/// Factors L D L^T of sparse symmetric matrices of one pattern. Without pivoting, so that the signs
/// of D are those of the eigenvalues (Sylvester's law of inertia).
class SymmetricFactors {
 public:
  explicit SymmetricFactors(const LowerTriangle &pattern) { factors.analyzePattern(pattern); }

  /// False if a pivot is zero.
  bool factorise(const LowerTriangle &matrix)
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

  /// For several right-hand sides, one after the other.
  void solve(const double *right, std::size_t n_sides, double *solution) const
  {
    const Eigen::Index n = factors.rows();
    for (std::size_t k = 0; k < n_sides; ++k) {
      const Eigen::Map<const Eigen::VectorXd> b(right + k * n, n);
      Eigen::Map<Eigen::VectorXd>(solution + k * n, n) = factors.solve(b);
    }
  }

 private:
  Eigen::SimplicialLDLT<LowerTriangle, Eigen::Lower, Eigen::AMDOrdering<int>> factors;
};

}  // namespace jamshape
