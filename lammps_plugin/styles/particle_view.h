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
  /// Makes an atom an ellipsoid of density 1.
  void set_diameters(int i, const Vec<3> &diameters) const;

  /// Shows atoms 0 to n - 1 as `visit(begin, end)`, at most BLOCK of them at a time: so few that
  /// what one pass over them reads is in the cache for the next.
  static constexpr int BLOCK = 256;
  template <class Visit> static void in_blocks(int n, const Visit &visit)
  {
    for (int begin = 0; begin < n; begin += BLOCK) visit(begin, std::min(begin + BLOCK, n));
  }

  /// Shows the orientations of atoms begin to end - 1 (own first, then ghosts) as `visit(i, q)`:
  /// for many atoms less work than to ask for each.
  template <class Visit> void for_each_orientation(int begin, int end, const Visit &visit) const
  {
    in_blocks(end - begin, [&](int first, int last) {
      int index[BLOCK];
      double packed[PER_ORIENTATION * BLOCK];
      const int size = last - first;
      std::iota(index, index + size, begin + first);
      ellipsoids()->pack_comm_bonus(size, index, packed);
      for (int k = 0; k < size; ++k) {
        visit(begin + first + k, quaternion(packed + PER_ORIENTATION * k));
      }
    });
  }

  template <class Visit> void for_each_orientation(int n, const Visit &visit) const
  {
    for_each_orientation(0, n, visit);
  }

  /// Gives atoms begin to end - 1 the orientations `orientation_of(i)`.
  template <class Of> void set_orientations(int begin, int end, const Of &orientation_of) const
  {
    in_blocks(end - begin, [&](int first, int last) {
      double packed[PER_ORIENTATION * BLOCK];
      for (int k = 0; k < last - first; ++k) {
        const Quaternion q = orientation_of(begin + first + k);
        double *const to = packed + PER_ORIENTATION * k;
        to[0] = q.w;
        to[1] = q.i;
        to[2] = q.j;
        to[3] = q.k;
      }
      ellipsoids()->unpack_comm_bonus(last - first, begin + first, packed);
    });
  }

 private:
  static constexpr int PER_ORIENTATION = 4, PER_SHAPE = 8;

  LAMMPS_NS::AtomVecEllipsoid *ellipsoids() const;
  static Quaternion quaternion(const double *q) { return {q[0], q[1], q[2], q[3]}; }
};

}  // namespace jamshape
