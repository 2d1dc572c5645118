#pragma once

#include "landscape/block_kernels.hpp"

#include <cstdint>

namespace jamshape {

/// The first half of a number in single precision, the format bfloat16: eight bits.
using FirstHalf = std::uint16_t;

/// Kernels of the method L-BFGS, whose time is that of reading the steps that it remembers. All
/// sets round identically.
struct HistoryKernels {
  static constexpr int AT_ONCE = 32;

  /// Rounds `by` times a vector (n,).
  void (*shorten)(int n, double by, const double *vector, FirstHalf *to);
  /// The dot product of two vectors (n,), n a multiple of AT_ONCE.
  float (*dot)(int n, const FirstHalf *a, const FirstHalf *b);
  /// Adds `by` times a vector (n,) to x, and returns the dot product of x and a further one; n is a
  /// multiple of AT_ONCE.
  float (*add_and_dot)(int n, float by, const FirstHalf *vector, const FirstHalf *further,
                       float *x);
};

/// Compiled in history_kernels.cpp for each instruction set.
template <InstructionSet SET> HistoryKernels history_kernels_of();

inline HistoryKernels history_kernels()
{
  return best_compiled([](auto one) { return &history_kernels_of<decltype(one)::value>; });
}

}  // namespace jamshape
