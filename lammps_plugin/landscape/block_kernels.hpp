#pragma once

#include "contact/instruction_set.hpp"

namespace jamshape {

/// A block of a triangle as its row refers to it.
struct LeftBlock {
  int column, block;
};

/// A symmetric matrix of n rows of blocks, or its factors L D L^T: blocks on the diagonal, where
/// factors have the pivots D, and below it, each BLOCK x BLOCK in columns. `BlockPattern` gives
/// their places.
struct BlockView {
  int n;
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
  /// Returns false if a pivot is not positive.
  bool (*factorise)(const BlockView &matrix);
  /// Replaces x by the solution.
  void (*solve)(const BlockView &factors, double *x);
  /// Sets y, zero before, to the product with x.
  void (*multiply)(const BlockView &matrix, const double *x, double *y);
};

/// Compiled in block_kernels.cpp for each instruction set.
template <InstructionSet SET, int BLOCK> BlockKernels block_kernels_of();

/// Kernels for the best set of this machine.
template <int BLOCK> BlockKernels block_kernels()
{
  const InstructionSet set = required_instruction_set();
  auto *const best =
      compiled_for(set == InstructionSet::scalar ? InstructionSet::baseline : set,
                   [](auto one) { return &block_kernels_of<decltype(one)::value, BLOCK>; });
  return best();
}

}  // namespace jamshape
