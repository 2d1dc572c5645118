#pragma once

#include "bindings/arrays.hpp"
#include "packing/pair_sum.hpp"

#include <algorithm>
#include <cstdint>

namespace jamshape {

/// Throws unless pairs (M, 2) and shift (M, D) are of N particles.
inline void require_pairs(const Array2<std::int64_t> &pairs, const Array2<std::int64_t> &shift,
                          std::size_t D, std::size_t N)
{
  require(pairs.shape(1) == 2 && shift.shape(1) == D && shift.shape(0) == pairs.shape(0),
          "pairs and shift do not have shapes (M, 2) and (M, D).");
  const std::int64_t *const first = pairs.data(), *const last = first + pairs.size();
  require(std::all_of(first, last,
                      [&](std::int64_t i) { return i >= 0 && static_cast<std::size_t>(i) < N; }),
          "a pair names a particle that does not exist.");
}

/// Poses of particles as double-doubles, as they come from Python.
struct PoseArrays {
  const Array3<double> &position;     // (2, N, D)
  const Array3<double> &orientation;  // (2, N, 1) or (2, N, 4)
  const Array3<double> &cell;         // (2, D, D)

  [[gnu::noinline]] void check(std::size_t N, std::size_t D) const
  {
    require(position.shape(0) == 2 && position.shape(1) == N && position.shape(2) == D,
            "position does not have the shape (2, N, D).");
    require(orientation.shape(0) == 2 && orientation.shape(1) == N &&
                orientation.shape(2) == (D == 2 ? 1 : 4),
            "orientation does not have the shape (2, N, 1) in 2D or (2, N, 4) in 3D.");
    require_finite(position, "position");
    require_finite(orientation, "orientation");
    require_orientations(orientation.data(), N, D);
    require_cell(cell, D);
  }

  SplitPoses poses() const
  {
    const auto parts = [](const auto &of) {
      return SplitPoses::View{of.data(), of.data() + of.size() / 2};
    };
    return {parts(position), parts(orientation), parts(cell)};
  }
};

/// Poses of particles and some of their pairs.
struct PairArrays : PoseArrays {
  const Array2<std::int64_t> &pairs;  // (M, 2)
  const Array2<std::int64_t> &shift;  // (M, D)

  void check(std::size_t N, std::size_t D) const
  {
    PoseArrays::check(N, D);
    require_pairs(pairs, shift, D, N);
  }

  PairList list() const { return {pairs.shape(0), pairs.data(), shift.data()}; }
};

}  // namespace jamshape
