#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "compat.h"
#include "pointers.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

namespace jamshape {

/// Resizes without the doubling that resize() grows by: numbers of ghosts vary by little.
template <class T> void resize_closely(std::vector<T> &values, std::size_t n)
{
  if (values.capacity() < n) values.reserve(n + n / 16);
  values.resize(n);
}

/// The only reader and writer of how LAMMPS stores ellipsoids: orientations and semi-axes of own
/// and ghost atoms. It keeps nothing: a copy of all orientations would be a tenth of the memory.
class ParticleView : protected LAMMPS_NS::Pointers {
 public:
  explicit ParticleView(LAMMPS_NS::LAMMPS *lmp) : Pointers(lmp) {}

  /// Stops with one sentence unless every atom is an ellipsoid. `style` is named in it.
  void require_ellipsoids(const std::string &style) const;

  Vec<3> semi_axes(int i) const;
  Quaternion orientation(int i) const;
  void set_orientation(int i, const Quaternion &q) const;

  /// Shows the orientations of atoms 0 to n - 1 (own first, then ghosts) as `visit(i, q)`: for
  /// many atoms less work than to ask for each.
  template <class Visit> void for_each_orientation(int n, const Visit &visit) const
  {
    int index[BLOCK];
    double packed[PER_ORIENTATION * BLOCK];
    for (int begin = 0; begin < n; begin += BLOCK) {
      const int size = std::min(BLOCK, n - begin);
      std::iota(index, index + size, begin);
      ellipsoids()->pack_comm_bonus(size, index, packed);
      for (int k = 0; k < size; ++k) visit(begin + k, quaternion(packed + PER_ORIENTATION * k));
    }
  }

 private:
  static constexpr int PER_ORIENTATION = 4, PER_SHAPE = 8, BLOCK = 256;

  LAMMPS_NS::AtomVecEllipsoid *ellipsoids() const;
  static Quaternion quaternion(const double *q) { return {q[0], q[1], q[2], q[3]}; }
};

}  // namespace jamshape
