#pragma once

#include "packing/laws.hpp"
#include "packing/near_spheres.hpp"
#include "packing/pair_sum.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace jamshape {

/// All pairs of posed particles whose surfaces are closer than a margin, and perhaps some that are
/// somewhat farther apart.
template <class Model, int D>
ListedPairs near_particles(const std::vector<typename Model::Shape> &shapes,
                           const Laws<typename Model::Law> &laws, const SplitPoses &poses,
                           double margin)
{
  constexpr double ROUNDING = 1e-9;  // of a margin, over the smallest length of a particle
  std::vector<double> around;
  double smallest = INFINITY;
  around.reserve(shapes.size());
  for (const typename Model::Shape &shape : shapes) {
    around.push_back(Model::template outer_radius<D>(shape) + 0.5 * margin);
    smallest = std::min(smallest, Model::template inner_radius<D>(shape));
  }
  ListedPairs found = NearSpheres<D>(poses.position[0], around, poses.cell[0]).find();
  const PairList list{found.size(), found.particles.data(), found.shift.data()};
  const PosedPairs<Model, D, double> posed(shapes, poses, list, laws);
  std::size_t kept = 0;
  each_closer(posed, margin + ROUNDING * smallest, [&](std::size_t p) {
    std::copy_n(&found.particles[2 * p], 2, &found.particles[2 * kept]);
    std::copy_n(&found.shift[D * p], D, &found.shift[D * kept]);
    ++kept;
  });
  found.particles.resize(2 * kept);
  found.shift.resize(D * kept);
  return found;
}

}  // namespace jamshape
