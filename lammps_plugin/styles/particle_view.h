#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "atom.h"
#include "compat.h"
#include "pointers.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

namespace jamshape {

/// Resizes without the doubling of capacity of resize(): numbers of ghosts vary little.
template <class T> void resize_closely(std::vector<T> &values, std::size_t n, const T &value = {})
{
  if (values.capacity() < n) values.reserve(n + n / 16);
  values.resize(n, value);
}

/// The only code that reads and writes LAMMPS's storage of ellipsoids: orientations and semi-axes
/// of own and ghost atoms. It keeps no copy: one of all orientations would be a tenth of the
/// memory.
class ParticleView : protected LAMMPS_NS::Pointers {
 public:
  explicit ParticleView(LAMMPS_NS::LAMMPS *lmp) : Pointers(lmp) {}

  /// Finds the ellipsoids among LAMMPS's atom styles, before any other call. Stops with an error,
  /// which names `style`, if there are none or they hold more than a shape.
  void find_ellipsoids(const std::string &style);

  bool has_shape(int i) const { return atom->ellipsoid[i] >= 0; }
  /// Zeros for an atom without a shape.
  Vec<3> semi_axes(int i) const;
  /// The exponents n1 and n2 of an atom with a shape, if the atom style has them: since LAMMPS
  /// 30Mar2026 one does.
  std::optional<std::array<double, 2>> exponents(int i) const;
  /// The identity for an atom without a shape.
  Quaternion orientation(int i) const;
  void set_orientation(int i, const Quaternion &q) const;
  /// Makes an atom an ellipsoid of density 1.
  void set_diameters(int i, const Vec<3> &diameters) const;

  /// Visits atoms 0 to n - 1 as `visit(begin, end)`, at most BLOCK of them at a time, so that the
  /// data read by one pass over them is in the cache for the next.
  static constexpr int BLOCK = 256;
  template <class Visit> static void in_blocks(int n, const Visit &visit)
  {
    for (int begin = 0; begin < n; begin += BLOCK) visit(begin, std::min(begin + BLOCK, n));
  }

  /// Visits the orientations of atoms begin to end - 1 (own first, then ghosts) with a shape as
  /// `visit(i, q)`: faster for many atoms than single queries.
  template <class Visit> void for_each_orientation(int begin, int end, const Visit &visit) const
  {
    in_blocks(end - begin, [&](int first, int last) {
      int index[BLOCK], size = 0;
      double packed[PER_ORIENTATION * BLOCK];
      const int from = begin + first, to = begin + last;
      if (all_have_shapes(from, to)) {  // always, except in hybrid pair styles
        std::iota(index, index + (to - from), from);
        ellipsoids->pack_comm_bonus(to - from, index, packed);
        for (int i = from; i < to; ++i) visit(i, quaternion(packed + PER_ORIENTATION * (i - from)));
        return;
      }
      for (int i = from; i < to; ++i) {
        if (has_shape(i)) index[size++] = i;
      }
      ellipsoids->pack_comm_bonus(size, index, packed);
      for (int k = 0; k < size; ++k) visit(index[k], quaternion(packed + PER_ORIENTATION * k));
    });
  }

  template <class Visit> void for_each_orientation(int n, const Visit &visit) const
  {
    for_each_orientation(0, n, visit);
  }

  /// Sets the orientations of atoms begin to end - 1 with a shape to `orientation_of(i)`.
  template <class Of> void set_orientations(int begin, int end, const Of &orientation_of) const
  {
    in_blocks(end - begin, [&](int first, int last) {
      if (!all_have_shapes(begin + first, begin + last)) {
        for (int i = begin + first; i < begin + last; ++i) {
          if (has_shape(i)) set_orientation(i, orientation_of(i));
        }
        return;
      }
      double packed[PER_ORIENTATION * BLOCK];
      for (int k = 0; k < last - first; ++k) {
        const Quaternion q = orientation_of(begin + first + k);
        double *const to = packed + PER_ORIENTATION * k;
        to[0] = q.w;
        to[1] = q.i;
        to[2] = q.j;
        to[3] = q.k;
      }
      ellipsoids->unpack_comm_bonus(last - first, begin + first, packed);
    });
  }

 private:
  static constexpr int PER_ORIENTATION = 4, PER_SHAPE = 8;
  static constexpr int PER_SHAPE_WITH_EXPONENTS = 13;  // and moments of inertia
  static constexpr int MOST_PER_SHAPE = 64;  // room for the data that versions keep beside a shape

  LAMMPS_NS::AtomVecEllipsoid *ellipsoids = nullptr;

  bool all_have_shapes(int begin, int end) const
  {
    const int *const index = atom->ellipsoid;  // negative without a shape
    int signs = 0;
    for (int i = begin; i < end; ++i) signs |= index[i];
    return signs >= 0;
  }

  static Quaternion quaternion(const double *q) { return {q[0], q[1], q[2], q[3]}; }
};

}  // namespace jamshape
