#pragma once

#include "landscape/symmetric_factors.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <utility>
#include <vector>

namespace jamshape {

/// Coordinates of a particle in the plane: x, y, rotation.
inline constexpr int BLOCK = 3;

using Block = Eigen::Matrix<double, BLOCK, BLOCK>;
using BlockVector = Eigen::Matrix<double, BLOCK, 1>;

/// Where a symmetric matrix of blocks, one row for each particle, and its factor L hold blocks: the
/// graph of the particles' contacts and what elimination adds to it. Made once for all matrices of
/// a list of pairs.
struct BlockPattern {
  /// Of N particles, whose coordinates have these numbers (N, 3), -1 for none, and the pairs of
  /// them (M, 2) that share a block.
  BlockPattern(std::vector<std::int64_t> numbers, const std::vector<std::int64_t> &pairs) :
      n(numbers.size() - std::count(numbers.begin(), numbers.end(), -1)),
      column(std::move(numbers)), place(ordered(column.size() / BLOCK, pairs))
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
      if (rows.empty()) continue;
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
  std::vector<std::int64_t> column;  // (N, 3)
  std::vector<int> place;            // (N,) of each particle in the order of elimination
  std::vector<int> first;            // (N + 1,) of the blocks below the diagonal, column by column
  std::vector<int> row;              // of each block, ascending within a column
  std::vector<int> first_left;       // (N + 1,) of the same blocks, row by row
  std::vector<Left> left;            // ascending within a row

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
    UpperTriangle neighbours(N, N);
    neighbours.setFromTriplets(entries.begin(), entries.end());
    const Order order = sparse_order(neighbours);
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

/// A symmetric matrix: the blocks on its diagonal, of which the lower triangle is read, and those
/// below it, zero where only the factor has them.
struct BlockMatrix {
  std::vector<Block> diagonal, below;
};

/// Factors L D L^T of symmetric positive definite matrices of one pattern, block by block: three
/// times faster than number by number. Pivots are single numbers, as without blocks, so that a
/// particle that is held in one direction only costs no digits. Coordinates that a particle does
/// not have are to have zeros in its blocks and 1 on the diagonal.
class BlockFactors {
 public:
  explicit BlockFactors(std::shared_ptr<const BlockPattern> of) :
      pattern(std::move(of)), inverse_pivots(pattern->size()), block_of_row(pattern->size())
  {
  }

  /// False, and no factors, where a pivot is not positive: then the matrix is not positive definite
  /// (Sylvester's law of inertia).
  bool factorise(const BlockMatrix &matrix)
  {
    factors = matrix;
    for (int j = 0; j < static_cast<int>(pattern->size()); ++j) {
      gather(j);
      if (!eliminate(j)) return false;
    }
    return true;
  }

  std::size_t size() const { return pattern->n; }

  /// For a right-hand side (n,) in the coordinates.
  Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const
  {
    std::vector<BlockVector> x(pattern->size(), BlockVector::Zero());
    const auto each = [&](const auto &then) {
      for (std::size_t k = 0; k < pattern->column.size(); ++k) {
        const std::int64_t c = pattern->column[k];
        if (c >= 0) then(c, x[pattern->place[k / BLOCK]][k % BLOCK]);
      }
    };
    each([&](std::int64_t c, double &component) { component = right[c]; });
    substitute(x);
    Eigen::VectorXd found(right.size());
    each([&](std::int64_t c, const double &component) { found[c] = component; });
    return found;
  }

 private:
  std::shared_ptr<const BlockPattern> pattern;
  BlockMatrix factors;  // L below the pivots, which its diagonal holds
  std::vector<BlockVector> inverse_pivots;
  std::vector<int> block_of_row;  // in the column that is being eliminated

  /// Takes off a column what the eliminated ones on its left add to it (left-looking).
  void gather(int j)
  {
    const BlockPattern &at = *pattern;
    for (int b = at.first[j]; b < at.first[j + 1]; ++b) block_of_row[at.row[b]] = b;
    for (int k = at.first_left[j]; k < at.first_left[j + 1]; ++k) {
      const auto [column, own] = at.left[k];
      const Block right =
          factors.diagonal[column].diagonal().asDiagonal() * factors.below[own].transpose();
      factors.diagonal[j].noalias() -= factors.below[own] * right;
      for (int b = own + 1; b < at.first[column + 1]; ++b) {
        factors.below[block_of_row[at.row[b]]].noalias() -= factors.below[b] * right;
      }
    }
  }

  /// Splits the diagonal block into l d l^T, and divides those below it by d l^T.
  bool eliminate(int j)
  {
    Block &l = factors.diagonal[j];
    BlockVector &inverse = inverse_pivots[j];
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
      below.col(1) -= l(1, 0) * below.col(0);
      below.col(2) -= l(2, 0) * below.col(0) + l(2, 1) * below.col(1);
      below = below * inverse.asDiagonal();
    }
    return true;
  }

  /// Forward and back substitution in place, for rows in the order of elimination.
  void substitute(std::vector<BlockVector> &x) const
  {
    const BlockPattern &at = *pattern;
    const auto n = static_cast<int>(at.size());
    for (int j = 0; j < n; ++j) {
      factors.diagonal[j].triangularView<Eigen::UnitLower>().solveInPlace(x[j]);
      for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
        x[at.row[b]].noalias() -= factors.below[b] * x[j];
      }
    }
    for (int j = n - 1; j >= 0; --j) {
      x[j] = x[j].cwiseProduct(inverse_pivots[j]);
      for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
        x[j].noalias() -= factors.below[b].transpose() * x[at.row[b]];
      }
      factors.diagonal[j].transpose().triangularView<Eigen::UnitUpper>().solveInPlace(x[j]);
    }
  }
};

}  // namespace jamshape
