#pragma once

#include "landscape/block_factors.hpp"
#include "landscape/supernode_kernels.hpp"

#include <algorithm>
#include <cstddef>
#include <Eigen/Core>
#include <memory>
#include <utility>
#include <vector>

namespace jamshape {

/// Supernodes of a pattern with complete fill-in (Ng & Peyton, SIAM J. Sci. Comput. 14, 1034
/// (1993)): neighbouring columns with the same rows below them, or nearly so, whose differing
/// blocks are zeros.
struct SupernodePattern {
  /// Supernodes whose blocks have this many rows.
  SupernodePattern(const BlockPattern &of, int block)
  {
    std::vector<Columns> found;
    for (int j = 0; j < static_cast<int>(of.size()); ++j) {
      Columns last{j, j + 1, of.first[j], of.first[j + 1], 0.0};
      for (; !found.empty() && is_joined(of, block, found.back(), last); found.pop_back()) {
        last = joined(found.back(), last);
      }
      found.push_back(last);
    }
    for (const Columns &one : found) {
      const auto s = static_cast<int>(column.size()) - 1;
      of_column.insert(of_column.end(), one.n(), s);
      column.push_back(one.end);
      row.insert(row.end(), of.row.begin() + one.first, of.row.begin() + one.last);
      first.push_back(static_cast<int>(row.size()));
      const int width = block * one.n(), height = width + block * one.below();
      const auto stride = static_cast<std::size_t>(supernode_stride(height));
      start.push_back(start.back() + stride * width);
      widest = std::max(widest, width);
      highest = std::max(highest, height);
    }
  }

  std::size_t size() const { return column.size() - 1; }

  std::vector<int> column{0}, first{0}, row, of_column;  // see SupernodeView
  std::vector<std::size_t> start{0};
  int widest = 0, highest = 0;

 private:
  /// Most coordinates of a supernode: columns of several stay in the cache together. And most of
  /// its blocks, over all, that are zeros.
  static constexpr int WIDEST = 96;
  static constexpr double ZEROS = 0.1;

  struct Columns {
    int begin, end, first, last;  // its columns and the rows below them
    double zeros;

    int n() const { return end - begin; }
    int below() const { return last - first; }
    double blocks() const { return n() * (0.5 * (n() + 1) + below()); }
  };

  static Columns joined(const Columns &one, const Columns &next)
  {
    const double added = static_cast<double>(one.n()) * (next.n() + next.below() - one.below());
    return {one.begin, next.end, next.first, next.last, one.zeros + next.zeros + added};
  }

  /// Whether columns are joined with the next ones, which have all their further rows if they have
  /// the first.
  static bool is_joined(const BlockPattern &of, int block, const Columns &one, const Columns &next)
  {
    if (one.below() == 0 || of.row[one.first] >= next.end) return false;
    const Columns both = joined(one, next);
    return block * both.n() <= WIDEST && both.zeros <= ZEROS * both.blocks();
  }
};

/// Factors with complete fill-in, supernode by supernode: where these are wide, as in space, most
/// of the work is products of dense matrices, near the peak performance of the processor.
template <int BLOCK> class SupernodeFactors : public Elimination<BLOCK> {
 public:
  SupernodeFactors(std::shared_ptr<const BlockPattern> of,
                   std::shared_ptr<const SupernodePattern> supernodes) :
      Elimination<BLOCK>(std::move(of)), super(std::move(supernodes)),
      numbers(super->start.back() + SUPERNODE_ROOM), inverse_pivots(BLOCK * pattern->size())
  {
  }

  bool factorise(const BlockMatrix<BLOCK> &matrix, const BlockRows<BLOCK> &added) override
  {
    const std::vector<BlockOf<BLOCK>> diagonal = matrix.diagonal_plus(added);
    BlockView shifted = matrix.view(*pattern);
    shifted.diagonal = numbers_of<BLOCK>(diagonal);
    singles.clear();
    std::vector<int> head(super->size()), next(super->size()), position(super->size());
    std::vector<int> local(pattern->size()), to(super->highest);
    std::vector<double> by(static_cast<std::size_t>(super->widest) * (super->widest + ROUNDED));
    return kernels.factorise(
        shifted, view(),
        {head.data(), next.data(), position.data(), local.data(), to.data(), by.data()});
  }

  Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd> &right) const override
  {
    return solved(right, view());
  }

  /// In single precision: a solution waits for the factors to be read.
  Eigen::VectorXd solve_nearly(const Eigen::Ref<const Eigen::VectorXd> &right) const override
  {
    if (singles.empty()) singles.assign(numbers.begin(), numbers.end());
    SupernodeView nearly = view();
    nearly.singles = singles.data();
    return solved(right, nearly);
  }

 private:
  /// Room for the last group of rows of a product.
  static constexpr int ROUNDED = 8;

  using Elimination<BLOCK>::pattern;
  std::shared_ptr<const SupernodePattern> super;
  SupernodeKernels kernels = supernode_kernels<BLOCK>();
  mutable std::vector<double> numbers, inverse_pivots;
  mutable std::vector<float> singles;  // once they are needed

  Eigen::VectorXd solved(const Eigen::Ref<const Eigen::VectorXd> &right,
                         const SupernodeView &with) const
  {
    BlockRows<BLOCK, BLOCK> x(*pattern, right);
    std::vector<double> part(super->highest);
    kernels.solve(with, x.data(), part.data());
    return x.gathered();
  }

  /// Kernels that only read change nothing.
  SupernodeView view() const
  {
    return {static_cast<int>(super->size()),
            super->column.data(),
            super->first.data(),
            super->row.data(),
            super->start.data(),
            super->of_column.data(),
            numbers.data(),
            inverse_pivots.data(),
            nullptr};
  }
};

}  // namespace jamshape
