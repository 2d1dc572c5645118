#pragma once

#include "contact/contact_block.hpp"

#include "landscape/block_kernels.hpp"

#include <cstddef>
#include <vector>

namespace jamshape {

/// Pairs of particles that were displaced since their separations were measured, as many as the
/// widest registers hold, one after the other in memory: reading them takes as long as computing.
template <int D> struct PairGroup {
  static constexpr int SIZE = 8;

  double apart[D][SIZE];  // x_i - x_j before the displacements, rounded to doubles,
  float rest[D][SIZE];    // and what that leaves
  float reach_sq[SIZE];   // squared distance at which bounding spheres touch, or slightly more
  int i[SIZE], j[SIZE];
};

/// Pairs after displacements (N, D), as in `Vectors`, and then a strain.
template <int D> struct MovedGroups {
  const PairGroup<D> *groups;
  const double *displacement;
  double strain;
};

/// (N, D) vectors in a row, and space to read four numbers from any of them on.
template <int D> class Vectors {
 public:
  explicit Vectors(std::size_t N) : numbers(D * N + 4) {}

  const double *data() const { return numbers.data(); }
  double *operator[](std::size_t n) { return &numbers[D * n]; }
  const double *operator[](std::size_t n) const { return &numbers[D * n]; }

 private:
  std::vector<double> numbers;
};

/// Kernels of pairs of displaced particles. All sets round identically.
template <int D> struct NearKernels {
  /// Adds to a block, until it is full, those of the pairs from `first` to `last` whose bounding
  /// spheres touch, without k_e, and the `number` of each. Returns where to resume.
  std::size_t (*touching)(const MovedGroups<D> &pairs, std::size_t first, std::size_t last,
                          ContactBlock<D> &block, int *number);
  /// The largest squared length of vectors (N, D), or of their sums with others.
  double (*longest_sq)(std::size_t N, const double *vectors, const double *others);
};

/// Compiled in near_kernels.cpp for each instruction set.
template <InstructionSet SET, int D> NearKernels<D> near_kernels_of();

template <int D> NearKernels<D> near_kernels()
{
  return best_compiled([](auto one) { return &near_kernels_of<decltype(one)::value, D>; });
}

}  // namespace jamshape
