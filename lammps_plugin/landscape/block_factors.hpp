#pragma once

#include "landscape/block_kernels.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <memory>
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
  /// The number of solutions that take as long as new factors.
  virtual double price() const = 0;
  /// Solution for a right-hand side (n,) in the coordinates.
  virtual Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const = 0;
  /// A less accurate one, to precondition iterations.
  virtual Eigen::VectorXd solve_nearly(const Eigen::Ref<const Eigen::VectorXd> &right) const
  {
    return solve(right);
  }
};

/// Whether factors include all fill-in of the elimination, or only blocks that the matrix itself
/// has: then they approximate it, in a small fraction of the memory and time.
enum class Fill { COMPLETE, NONE };

/// Sparsity pattern of a symmetric matrix of blocks, one row per particle, and of its factor L: the
/// graph of the particles' contacts and the fill-in.
struct BlockPattern {
  /// Pattern for N particles, the numbers (N + 1,) of their first coordinates, the pairs of them
  /// (M, 2) that share a block, and their places (N,) in the order of elimination.
  BlockPattern(std::vector<std::int64_t> first_coordinates, const std::vector<std::int64_t> &pairs,
               std::vector<int> order, Fill what_fill) :
      coordinate(std::move(first_coordinates)), fill(what_fill), place(std::move(order))
  {
    std::vector<std::vector<int>> below(size());
    for (std::size_t p = 0; p < pairs.size(); p += 2) {
      const auto [low, high] = std::minmax(place[pairs[p]], place[pairs[p + 1]]);
      if (low < high) below[low].push_back(high);
    }
    own_first.push_back(0);
    for (std::vector<int> &rows : below) {
      sort_once(rows);
      own_row.insert(own_row.end(), rows.begin(), rows.end());
      own_first.push_back(static_cast<int>(own_row.size()));
    }
    // The rows of a column couple to each other once it is eliminated: handing the rest to the
    // first of them suffices, as it will hand them on (elimination tree: Liu, SIAM J. Matrix Anal.
    // Appl. 11, 134 (1990)).
    first.push_back(0);
    for (std::vector<int> &rows : below) {
      sort_once(rows);
      row.insert(row.end(), rows.begin(), rows.end());
      first.push_back(static_cast<int>(row.size()));
      if (rows.empty() || fill == Fill::NONE) continue;
      std::vector<int> &next = below[rows.front()];
      next.insert(next.end(), rows.begin() + 1, rows.end());
    }
    list_by_rows();
  }

  std::size_t size() const { return place.size(); }
  /// The number of coordinates.
  std::size_t n() const { return coordinate.back(); }
  /// The number of those of a particle.
  int count(std::size_t i) const { return static_cast<int>(coordinate[i + 1] - coordinate[i]); }

  /// The number of solutions that take as long as new factors, with blocks of this many columns. A
  /// solution waits for blocks to be read; a product of two blocks takes that time for this number
  /// of columns.
  double price(int block) const
  {
    constexpr double COLUMNS_PER_SOLUTION = 15.0;
    double products = 0.0;
    for (std::size_t j = 0; j < size(); ++j) {
      const double below = first[j + 1] - first[j];
      products += below * below;
    }
    const auto blocks = static_cast<double>(std::max<std::size_t>(row.size(), 1));
    return block * products / blocks / COLUMNS_PER_SOLUTION;
  }

  /// The number of the matrix's block below a diagonal one in a row.
  int find(int below, int row_sought) const
  {
    const auto begin = own_row.begin() + own_first[below];
    const auto end = own_row.begin() + own_first[below + 1];
    return static_cast<int>(std::lower_bound(begin, end, row_sought) - own_row.begin());
  }

  std::vector<std::int64_t> coordinate;  // (N + 1,) first of each particle
  Fill fill;
  std::vector<int> place;       // (N,) place of each particle in the order of elimination
  std::vector<int> own_first;   // (N + 1,) first block of the matrix below the diagonal, by columns
  std::vector<int> own_row;     // row of each of these, ascending within a column
  std::vector<int> first;       // (N + 1,) the same of the factor,
  std::vector<int> row;         // which has more where there is fill-in
  std::vector<int> first_left;  // (N + 1,) first of the same blocks, row by row
  std::vector<LeftBlock> left;  // ascending within a row

 private:
  static void sort_once(std::vector<int> &rows)
  {
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
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

template <int BLOCK> const double *numbers_of(const std::vector<BlockOf<BLOCK>> &blocks)
{
  return blocks.empty() ? nullptr : blocks.data()->data();
}

/// A vector in the coordinates and its blocks, in the order of elimination; zero for coordinates
/// that a particle does not have.
template <int BLOCK, int STRIDE = stride_of(BLOCK)> class BlockRows {
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
    Eigen::VectorXd found(static_cast<Eigen::Index>(pattern.n()));
    each([&](std::int64_t c, const double &component) { found[c] = component; });
    return found;
  }

 private:
  const BlockPattern &pattern;
  std::vector<double> x;

  template <class Then> void each(const Then &then)
  {
    for (std::size_t i = 0; i < pattern.size(); ++i) {
      const std::int64_t first = pattern.coordinate[i];
      double *const row = &x[STRIDE * pattern.place[i]];
      const int n = pattern.count(i);
      if (n == BLOCK) {  // unrolled
        for (int k = 0; k < BLOCK; ++k) then(first + k, row[k]);
      } else {
        for (int k = 0; k < n; ++k) then(first + k, row[k]);
      }
    }
  }
};

/// A symmetric matrix: the blocks on its diagonal, and those below it, without fill-in.
template <int BLOCK> struct BlockMatrix {
  std::vector<BlockOf<BLOCK>> diagonal, below;

  BlockView view(const BlockPattern &of) const
  {
    return {static_cast<int>(of.size()), of.own_first.data(), of.own_row.data(),
            numbers_of<BLOCK>(diagonal), numbers_of<BLOCK>(below)};
  }

  /// Blocks on the diagonal plus those of a diagonal matrix, its rows in the order of elimination.
  std::vector<BlockOf<BLOCK>> diagonal_plus(const BlockRows<BLOCK> &added) const
  {
    std::vector<BlockOf<BLOCK>> sum = diagonal;
    for (std::size_t j = 0; j < sum.size(); ++j) {
      for (int k = 0; k < BLOCK; ++k) sum[j](k, k) += added.row(j)[k];
    }
    return sum;
  }
};

/// Factors L D L^T of symmetric positive definite matrices of one pattern. Pivots are single
/// numbers, as without blocks, so that a particle constrained in one direction only costs no
/// digits. Coordinates that a particle does not have need zeros in its blocks and 1 on the
/// diagonal.
template <int BLOCK> class Elimination : public Factors {
 public:
  explicit Elimination(std::shared_ptr<const BlockPattern> of) : pattern(std::move(of)) {}

  /// Factors of a matrix plus a diagonal, its rows in the order of elimination. False, and no
  /// factors, if a pivot is not positive: then the matrix is not positive definite (Sylvester's law
  /// of inertia), if the fill is complete.
  virtual bool factorise(const BlockMatrix<BLOCK> &matrix, const BlockRows<BLOCK> &added) = 0;

  std::size_t size() const override { return pattern->n(); }
  double price() const override { return pattern->price(BLOCK); }

 protected:
  std::shared_ptr<const BlockPattern> pattern;
};

/// Factors block by block: three times faster than element by element.
template <int BLOCK> class BlockFactors : public Elimination<BLOCK> {
 public:
  BlockFactors(std::shared_ptr<const BlockPattern> of, const BlockKernels &compiled) :
      Elimination<BLOCK>(std::move(of)), kernels(compiled), diagonal(pattern->size()),
      below(pattern->row.size()), inverse_pivots(BLOCK * pattern->size()),
      block_of_row(pattern->size()), column_of_row(pattern->size())
  {
  }

  bool factorise(const BlockMatrix<BLOCK> &matrix, const BlockRows<BLOCK> &added) override
  {
    diagonal = matrix.diagonal_plus(added);
    return kernels.factorise(matrix.view(*pattern), view());
  }

  Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const override
  {
    BlockRows<BLOCK> x(*pattern, right);
    kernels.solve(view(), x.data());
    return x.gathered();
  }

 private:
  using Elimination<BLOCK>::pattern;
  BlockKernels kernels;
  // L below the pivots, which its diagonal holds.
  mutable std::vector<BlockOf<BLOCK>> diagonal, below;
  mutable std::vector<double> inverse_pivots;
  mutable std::vector<int> block_of_row, column_of_row;  // work space

  /// Kernels that only read change nothing.
  FactorView view() const
  {
    return {static_cast<int>(pattern->size()),
            pattern->fill == Fill::COMPLETE,
            pattern->first.data(),
            pattern->row.data(),
            pattern->first_left.data(),
            pattern->left.data(),
            diagonal.data()->data(),
            below.empty() ? nullptr : below.data()->data(),
            inverse_pivots.data(),
            block_of_row.data(),
            column_of_row.data()};
  }
};

}  // namespace jamshape
