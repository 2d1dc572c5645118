#pragma once

#include "contact/instruction_set.hpp"

namespace jamshape {

/// A block of a triangle as its row sees it.
struct LeftBlock {
  int column, block;
};

/// A symmetric matrix of n rows of blocks, or its factors L D L^T: blocks on the diagonal, where
/// factors have the pivots D, and below it, each BLOCK x BLOCK in columns. Where they are:
/// `BlockPattern`.
struct BlockView {
  int n;
  const int *first, *row, *first_left;
  const LeftBlock *left;
  double *diagonal, *below, *inverse_pivots;
  int *block_of_row, *column_of_row;  // (n,) space to work in
};

/// From one row of a vector of blocks to the next: such that a register holds one.
inline constexpr int stride_of(int block) { return block == 3 ? 4 : block; }

/// What takes most of the time of linear algebra, compiled for one set of instructions. All sets
/// round alike.
struct BlockKernels {
  /// False where a pivot is not positive.
  bool (*factorise)(const BlockView &matrix);
  /// x to the solution, in place.
  void (*solve)(const BlockView &factors, double *x);
  /// y, zero before, to the product with x.
  void (*multiply)(const BlockView &matrix, const double *x, double *y);
};

/// Compiled in block_kernels.cpp for each set.
template <InstructionSet SET, int BLOCK> BlockKernels block_kernels_of();

/// For the best set of this machine.
template <int BLOCK> BlockKernels block_kernels()
{
  const InstructionSet set = required_instruction_set();
  auto *const best =
      compiled_for(set == InstructionSet::scalar ? InstructionSet::baseline : set,
                   [](auto one) { return &block_kernels_of<decltype(one)::value, BLOCK>; });
  return best();
}

}  // namespace jamshape
