#pragma once

#include "contact/instruction_set.hpp"

namespace jamshape {

/// A block of a triangle as its row refers to it.
struct LeftBlock {
  int column, block;
};

/// A symmetric matrix of n rows of blocks on the diagonal and below it, each BLOCK x BLOCK in
/// columns. `BlockPattern` gives their places.
struct BlockView {
  int n;
  const int *first, *row;
  const double *diagonal, *below;
};

/// Its factors L D L^T: the diagonal has the pivots D.
struct FactorView {
  int n;
  bool is_complete;  // whether the pattern has all fill-in
  const int *first, *row, *first_left;
  const LeftBlock *left;
  double *diagonal, *below, *inverse_pivots;
  int *block_of_row, *column_of_row;  // (n,) work space
};

/// Stride of the rows of a vector of blocks: a register holds one row.
inline constexpr int stride_of(int block) { return block == 3 ? 4 : block; }

/// The most expensive kernels of linear algebra, compiled for one instruction set. All sets round
/// identically.
struct BlockKernels {
  /// Sets the factors of a matrix whose diagonal they hold. Returns false if a pivot is not
  /// positive.
  bool (*factorise)(const BlockView &matrix, const FactorView &factors);
  /// Replaces x by the solution.
  void (*solve)(const FactorView &factors, double *x);
  /// Sets y, zero before, to the product with x.
  void (*multiply)(const BlockView &matrix, const double *x, double *y);
};

/// Compiled in block_kernels.cpp for each instruction set.
template <InstructionSet SET, int BLOCK> BlockKernels block_kernels_of();

/// Selects from functions compiled once per set the one for the best set of this machine.
template <class OfSet> auto best_compiled(const OfSet &of_set)
{
  const InstructionSet set = required_instruction_set();
  return compiled_for(set == InstructionSet::scalar ? InstructionSet::baseline : set, of_set)();
}

template <int BLOCK> BlockKernels block_kernels()
{
  return best_compiled([](auto one) { return &block_kernels_of<decltype(one)::value, BLOCK>; });
}

}  // namespace jamshape
