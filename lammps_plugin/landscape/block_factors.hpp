#pragma once

#include "landscape/block_kernels.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

namespace jamshape {

/// Smallest shift of a diagonal, over its largest element: just above the rounding of the
/// factorisation and its effect on stiff modes.
inline constexpr double LEAST_SHIFT = 1e-13;

/// Factors of a symmetric matrix, or of an approximation to it.
class Factors {
 public:
  virtual ~Factors() = default;
  virtual std::size_t size() const = 0;
  /// Solution for a right-hand side (n,) in the coordinates.
  virtual Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const = 0;
};

/// Whether factors include all fill-in of the elimination, or only blocks that the matrix itself
/// has: then they approximate it, in a small fraction of the memory and time.
enum class Fill { COMPLETE, NONE };

/// Sparsity pattern of a symmetric matrix of blocks, one row per particle, and of its factor L: the
/// graph of the particles' contacts and the fill-in. Made once for all matrices of a list of pairs.
struct BlockPattern {
  /// Pattern for N particles, whose coordinates have these numbers (N, block), -1 for none, and the
  /// pairs of them (M, 2) that share a block.
  BlockPattern(std::vector<std::int64_t> numbers, const std::vector<std::int64_t> &pairs,
               std::size_t N, Fill what_fill) :
      n(numbers.size() - std::count(numbers.begin(), numbers.end(), -1)),
      column(std::move(numbers)), fill(what_fill), place(ordered(N, pairs))
  {
    std::vector<std::vector<int>> below(size());
    for (std::size_t p = 0; p < pairs.size(); p += 2) {
      const auto [low, high] = std::minmax(place[pairs[p]], place[pairs[p + 1]]);
      if (low < high) below[low].push_back(high);
    }
    // The rows of a column couple to each other once it is eliminated: handing the rest to the
    // first of them suffices, as it will hand them on (elimination tree: Liu, SIAM J. Matrix Anal.
    // Appl. 11, 134 (1990)).
    first.push_back(0);
    for (std::vector<int> &rows : below) {
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      row.insert(row.end(), rows.begin(), rows.end());
      first.push_back(static_cast<int>(row.size()));
      if (rows.empty() || fill == Fill::NONE) continue;
      std::vector<int> &next = below[rows.front()];
      next.insert(next.end(), rows.begin() + 1, rows.end());
    }
    list_by_rows();
  }

  std::size_t size() const { return place.size(); }

  /// The number of the block below a diagonal one in a row.
  int find(int below, int row_sought) const
  {
    const auto begin = row.begin() + first[below], end = row.begin() + first[below + 1];
    return static_cast<int>(std::lower_bound(begin, end, row_sought) - row.begin());
  }

  std::size_t n;                     // coordinates
  std::vector<std::int64_t> column;  // (N, block)
  Fill fill;
  std::vector<int> place;       // (N,) place of each particle in the order of elimination
  std::vector<int> first;       // (N + 1,) first block below the diagonal, column by column
  std::vector<int> row;         // row of each block, ascending within a column
  std::vector<int> first_left;  // (N + 1,) first of the same blocks, row by row
  std::vector<LeftBlock> left;  // ascending within a row

 private:
  /// An order of elimination with little fill-in (approximate minimum degree), if there will be
  /// any.
  std::vector<int> ordered(std::size_t N, const std::vector<std::int64_t> &pairs) const
  {
    if (fill == Fill::NONE) {
      std::vector<int> as_they_are(N);
      std::iota(as_they_are.begin(), as_they_are.end(), 0);
      return as_they_are;
    }
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t i = 0; i < N; ++i) entries.emplace_back(i, i, 1.0);
    for (std::size_t p = 0; p < pairs.size(); p += 2) {
      const auto [low, high] = std::minmax(pairs[p], pairs[p + 1]);
      entries.emplace_back(low, high, 1.0);
    }
    Eigen::SparseMatrix<double> neighbours(N, N);
    neighbours.setFromTriplets(entries.begin(), entries.end());
    Eigen::AMDOrdering<int>::PermutationType inverse;
    Eigen::AMDOrdering<int>()(neighbours.selfadjointView<Eigen::Upper>(), inverse);
    const auto order = inverse.inverse().eval();
    return {order.indices().data(), order.indices().data() + N};
  }

  void list_by_rows()
  {
    first_left.assign(size() + 1, 0);
    for (const int r : row) ++first_left[r + 1];
    for (std::size_t r = 0; r < size(); ++r) first_left[r + 1] += first_left[r];
    std::vector<int> next(first_left.begin(), first_left.end() - 1);
    left.resize(row.size());
    for (int j = 0; j < static_cast<int>(size()); ++j) {
      for (int b = first[j]; b < first[j + 1]; ++b) left[next[row[b]]++] = {j, b};
    }
  }
};

template <int BLOCK> using BlockOf = Eigen::Matrix<double, BLOCK, BLOCK>;

/// A symmetric matrix: the blocks on its diagonal, and those below it, zero where only the factor
/// has them.
template <int BLOCK> struct BlockMatrix {
  std::vector<BlockOf<BLOCK>> diagonal, below;

  /// View of its numbers; kernels that only read change nothing.
  BlockView view(const BlockPattern &of) const
  {
    BlockView at{};
    at.n = static_cast<int>(of.size());
    at.is_complete = of.fill == Fill::COMPLETE;
    at.first = of.first.data();
    at.row = of.row.data();
    at.first_left = of.first_left.data();
    at.left = of.left.data();
    at.diagonal = const_cast<double *>(diagonal.data()->data());
    at.below = below.empty() ? nullptr : const_cast<double *>(below.data()->data());
    return at;
  }
};

/// A vector in the coordinates and its blocks, in the order of elimination; zero for coordinates
/// that a particle does not have.
template <int BLOCK> class BlockRows {
 public:
  explicit BlockRows(const BlockPattern &of) : pattern(of), x(STRIDE * of.size()) {}

  BlockRows(const BlockPattern &of, const Eigen::Ref<const Eigen::VectorXd> &from) : BlockRows(of)
  {
    each([&](std::int64_t c, double &component) { component = from[c]; });
  }

  double *data() { return x.data(); }
  const double *row(std::size_t k) const { return &x[STRIDE * k]; }

  Eigen::VectorXd gathered()
  {
    Eigen::VectorXd found(static_cast<Eigen::Index>(pattern.n));
    each([&](std::int64_t c, const double &component) { found[c] = component; });
    return found;
  }

 private:
  static constexpr std::size_t STRIDE = stride_of(BLOCK);

  const BlockPattern &pattern;
  std::vector<double> x;

  template <class Then> void each(const Then &then)
  {
    for (std::size_t k = 0; k < pattern.column.size(); ++k) {
      const std::int64_t c = pattern.column[k];
      if (c >= 0) then(c, x[STRIDE * pattern.place[k / BLOCK] + k % BLOCK]);
    }
  }
};

/// Factors L D L^T of symmetric positive definite matrices of one pattern, block by block: three
/// times faster than element by element. Pivots are single numbers, as without blocks, so that a
/// particle constrained in one direction only costs no digits. Coordinates that a particle does not
/// have need zeros in its blocks and 1 on the diagonal.
template <int BLOCK> class BlockFactors : public Factors {
 public:
  BlockFactors(std::shared_ptr<const BlockPattern> of, const BlockKernels &compiled) :
      pattern(std::move(of)), kernels(compiled), inverse_pivots(BLOCK * pattern->size()),
      block_of_row(pattern->size()), column_of_row(pattern->size())
  {
  }

  /// Factors of a matrix plus a diagonal, its rows in the order of elimination. False, and no
  /// factors, if a pivot is not positive: then the matrix is not positive definite (Sylvester's law
  /// of inertia), if the fill is complete.
  bool factorise(const BlockMatrix<BLOCK> &matrix, const BlockRows<BLOCK> &added)
  {
    factors = matrix;
    for (std::size_t j = 0; j < pattern->size(); ++j) {
      for (int k = 0; k < BLOCK; ++k) factors.diagonal[j](k, k) += added.row(j)[k];
    }
    BlockView at = factors.view(*pattern);
    at.inverse_pivots = inverse_pivots.data();
    at.block_of_row = block_of_row.data();
    at.column_of_row = column_of_row.data();
    return kernels.factorise(at);
  }

  std::size_t size() const override { return pattern->n; }

  Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const override
  {
    BlockRows<BLOCK> x(*pattern, right);
    BlockView at = factors.view(*pattern);
    at.inverse_pivots = const_cast<double *>(inverse_pivots.data());
    kernels.solve(at, x.data());
    return x.gathered();
  }

 private:
  std::shared_ptr<const BlockPattern> pattern;
  BlockKernels kernels;
  BlockMatrix<BLOCK> factors;  // L below the pivots, which its diagonal holds
  std::vector<double> inverse_pivots;
  std::vector<int> block_of_row, column_of_row;  // work space
};

}  // namespace jamshape
