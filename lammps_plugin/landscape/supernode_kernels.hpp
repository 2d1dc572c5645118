#pragma once

#include "landscape/block_kernels.hpp"

#include <cstddef>

namespace jamshape {

/// A factor L in supernodes: neighbouring block columns whose rows below are the same, stored as
/// one dense matrix in columns, those on the diagonal first.
struct SupernodeView {
  int n;
  const int *column;         // (n + 1,) first block column of each
  const int *first;          // (n + 1,) first of the block rows below its columns
  const int *row;            // these rows, ascending
  const std::size_t *start;  // (n + 1,) first number of each
  const int *of_column;      // (N,) supernode of a block column
  double *numbers;           // with the pivots D on the diagonal, and more room at the end
  double *inverse_pivots;
  const float *singles;  // the numbers in single precision, used for solutions if given
};

/// Distance of the columns of a supernode of this height: an odd number of cache lines, so that
/// neighbours do not displace each other from the cache.
inline int supernode_stride(int height)
{
  constexpr int LINE = 8;
  return ((height + LINE - 1) / LINE | 1) * LINE;
}

/// Numbers that may be read beyond the last column.
inline constexpr int SUPERNODE_ROOM = 32;

struct SupernodeWork {
  int *head, *next, *position;  // (n,) lists of those that contribute to one, and from which row
  int *local;                   // (N,) row of a block in a supernode
  int *to;                      // (highest,) rows in one of the rows of another
  double *by;                   // (widest, widest) factors of a product
};

struct SupernodeKernels {
  /// Sets the factors of a matrix. Returns false if a pivot is not positive.
  bool (*factorise)(const BlockView &matrix, const SupernodeView &factors,
                    const SupernodeWork &work);
  /// Replaces x (BLOCK N,) by the solution; `part` (highest,) is work space.
  void (*solve)(const SupernodeView &factors, double *x, double *part);
};

/// Compiled in supernode_kernels.cpp for each instruction set, with fused multiplications and
/// additions where the set has them: the last bits depend on it.
template <InstructionSet SET, int BLOCK> SupernodeKernels supernode_kernels_of();

template <int BLOCK> SupernodeKernels supernode_kernels()
{
  return best_compiled([](auto one) { return &supernode_kernels_of<decltype(one)::value, BLOCK>; });
}

}  // namespace jamshape
