#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <memory>
#include <utility>
#include <vector>

namespace jamshape {

/// The smallest shift of a diagonal, over its largest element: rounding in the factorisation is
/// just below it, and so is what it does to modes that are stiff at all.
inline constexpr double LEAST_SHIFT = 1e-13;

/// Factors of a symmetric matrix, or of one that is nearly it.
class Factors {
 public:
  virtual ~Factors() = default;
  virtual std::size_t size() const = 0;
  /// For a right-hand side (n,) in the coordinates.
  virtual Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const = 0;
};

/// Whether factors hold all that elimination adds to a matrix, or only blocks where it has some
/// itself: then they are those of a matrix nearby, in a small part of the memory and time.
enum class Fill { COMPLETE, NONE };

/// Where a symmetric matrix of blocks, one row for each particle of so many coordinates, and its
/// factor L hold blocks: the graph of the particles' contacts and what elimination adds to it. Made
/// once for all matrices of a list of pairs.
struct BlockPattern {
  /// Of N particles, whose coordinates have these numbers (N, block), -1 for none, and the pairs of
  /// them (M, 2) that share a block.
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
    // A column's rows couple to each other once it is eliminated: the first of them takes the rest,
    // which suffices, as it will hand them on (elimination tree: Liu, SIAM J. Matrix Anal. Appl.
    // 11, 134 (1990)).
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

  /// A block as its row sees it.
  struct Left {
    int column, block;
  };

  std::size_t n;                     // coordinates
  std::vector<std::int64_t> column;  // (N, block)
  Fill fill;
  std::vector<int> place;       // (N,) of each particle in the order of elimination
  std::vector<int> first;       // (N + 1,) of the blocks below the diagonal, column by column
  std::vector<int> row;         // of each block, ascending within a column
  std::vector<int> first_left;  // (N + 1,) of the same blocks, row by row
  std::vector<Left> left;       // ascending within a row

 private:
  /// In an order in which few blocks are added (approximate minimum degree).
  static std::vector<int> ordered(std::size_t N, const std::vector<std::int64_t> &pairs)
  {
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
template <int BLOCK> using BlockRow = Eigen::Matrix<double, BLOCK, 1>;

/// A symmetric matrix: the blocks on its diagonal, and those below it, zero where only the factor
/// has them.
template <int BLOCK> struct BlockMatrix {
  std::vector<BlockOf<BLOCK>> diagonal, below;
};

/// A vector in the coordinates and the same by blocks, in the order of elimination; zero for
/// coordinates that a particle does not have.
template <int BLOCK> class BlockRows {
 public:
  explicit BlockRows(const BlockPattern &of) : pattern(of), x(of.size(), BlockRow<BLOCK>::Zero()) {}

  BlockRows(const BlockPattern &of, const Eigen::Ref<const Eigen::VectorXd> &from) : BlockRows(of)
  {
    each([&](std::int64_t c, double &component) { component = from[c]; });
  }

  BlockRow<BLOCK> &operator[](std::size_t k) { return x[k]; }

  Eigen::VectorXd gathered()
  {
    Eigen::VectorXd found(static_cast<Eigen::Index>(pattern.n));
    each([&](std::int64_t c, const double &component) { found[c] = component; });
    return found;
  }

 private:
  const BlockPattern &pattern;
  std::vector<BlockRow<BLOCK>> x;

  template <class Then> void each(const Then &then)
  {
    for (std::size_t k = 0; k < pattern.column.size(); ++k) {
      const std::int64_t c = pattern.column[k];
      if (c >= 0) then(c, x[pattern.place[k / BLOCK]][static_cast<Eigen::Index>(k % BLOCK)]);
    }
  }
};

/// A matrix times a vector (n,) in the coordinates.
template <int BLOCK>
Eigen::VectorXd product(const BlockPattern &pattern, const BlockMatrix<BLOCK> &matrix,
                        const Eigen::Ref<const Eigen::VectorXd> &vector)
{
  BlockRows<BLOCK> x(pattern, vector), y(pattern);
  for (std::size_t j = 0; j < pattern.size(); ++j) {
    BlockRow<BLOCK> sum = matrix.diagonal[j] * x[j];
    for (int b = pattern.first[j]; b < pattern.first[j + 1]; ++b) {
      y[pattern.row[b]].noalias() += matrix.below[b] * x[j];
      sum.noalias() += matrix.below[b].transpose() * x[pattern.row[b]];
    }
    y[j] += sum;
  }
  return y.gathered();
}

/// Factors L D L^T of symmetric positive definite matrices of one pattern, block by block: three
/// times faster than number by number. Pivots are single numbers, as without blocks, so that a
/// particle that is held in one direction only costs no digits. Coordinates that a particle does
/// not have are to have zeros in its blocks and 1 on the diagonal.
template <int BLOCK> class BlockFactors : public Factors {
 public:
  explicit BlockFactors(std::shared_ptr<const BlockPattern> of) :
      pattern(std::move(of)), inverse_pivots(pattern->size()), block_of_row(pattern->size()),
      column_of_row(pattern->size())
  {
  }

  /// Of a matrix with a diagonal added, its rows in the order of elimination. False, and no
  /// factors, where a pivot is not positive: then the matrix is not positive definite (Sylvester's
  /// law of inertia), if fill is complete.
  bool factorise(const BlockMatrix<BLOCK> &matrix, BlockRows<BLOCK> &added)
  {
    factors = matrix;
    std::fill(column_of_row.begin(), column_of_row.end(), -1);
    for (int j = 0; j < static_cast<int>(pattern->size()); ++j) {
      factors.diagonal[j].diagonal() += added[j];
      gather(j);
      if (!eliminate(j)) return false;
    }
    return true;
  }

  std::size_t size() const override { return pattern->n; }

  Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const override
  {
    BlockRows<BLOCK> x(*pattern, right);
    substitute(x);
    return x.gathered();
  }

 private:
  using Block = BlockOf<BLOCK>;
  std::shared_ptr<const BlockPattern> pattern;
  BlockMatrix<BLOCK> factors;  // L below the pivots, which its diagonal holds
  std::vector<BlockRow<BLOCK>> inverse_pivots;
  std::vector<int> block_of_row, column_of_row;  // in the column that is being eliminated

  /// Takes off a column what the eliminated ones on its left add to it (left-looking), but for
  /// blocks that the pattern does not have.
  void gather(int j)
  {
    const BlockPattern &at = *pattern;
    for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
      block_of_row[at.row[b]] = b;
      column_of_row[at.row[b]] = j;
    }
    for (int k = at.first_left[j]; k < at.first_left[j + 1]; ++k) {
      const auto [column, own] = at.left[k];
      const Block right =
          factors.diagonal[column].diagonal().asDiagonal() * factors.below[own].transpose();
      factors.diagonal[j].noalias() -= factors.below[own] * right;
      for (int b = own + 1; b < at.first[column + 1]; ++b) {
        const int r = at.row[b];
        if (column_of_row[r] != j) continue;
        factors.below[block_of_row[r]].noalias() -= factors.below[b] * right;
      }
    }
  }

  /// Splits the diagonal block into l d l^T, and divides those below it by d l^T.
  bool eliminate(int j)
  {
    Block &l = factors.diagonal[j];
    BlockRow<BLOCK> &inverse = inverse_pivots[j];
    for (int k = 0; k < BLOCK; ++k) {
      if (!(l(k, k) > 0.0)) return false;
      inverse[k] = 1.0 / l(k, k);
      for (int c = k + 1; c < BLOCK; ++c) {
        for (int r = c; r < BLOCK; ++r) l(r, c) -= l(r, k) * inverse[k] * l(c, k);
      }
      for (int r = k + 1; r < BLOCK; ++r) l(r, k) *= inverse[k];
    }
    for (int b = pattern->first[j]; b < pattern->first[j + 1]; ++b) {
      Block &below = factors.below[b];
      for (int c = 1; c < BLOCK; ++c) {
        for (int k = 0; k < c; ++k) below.col(c) -= l(c, k) * below.col(k);
      }
      below = below * inverse.asDiagonal();
    }
    return true;
  }

  /// Forward and back substitution in place.
  void substitute(BlockRows<BLOCK> &x) const
  {
    const BlockPattern &at = *pattern;
    const auto n = static_cast<int>(at.size());
    for (int j = 0; j < n; ++j) {
      factors.diagonal[j].template triangularView<Eigen::UnitLower>().solveInPlace(x[j]);
      for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
        x[at.row[b]].noalias() -= factors.below[b] * x[j];
      }
    }
    for (int j = n - 1; j >= 0; --j) {
      x[j] = x[j].cwiseProduct(inverse_pivots[j]);
      for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
        x[j].noalias() -= factors.below[b].transpose() * x[at.row[b]];
      }
      factors.diagonal[j].transpose().template triangularView<Eigen::UnitUpper>().solveInPlace(
          x[j]);
    }
  }
};

}  // namespace jamshape
