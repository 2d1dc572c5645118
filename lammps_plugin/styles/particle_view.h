#pragma once

#include "contact/rotation.hpp"
#include "contact/vec.hpp"

#include "compat.h"
#include "pointers.h"

#include <cstddef>
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
/// and ghost atoms, gathered into plain arrays.
class ParticleView : protected LAMMPS_NS::Pointers {
 public:
  explicit ParticleView(LAMMPS_NS::LAMMPS *lmp) : Pointers(lmp) {}

  /// Stops with one sentence unless every atom is an ellipsoid. `style` is named in it.
  void require_ellipsoids(const std::string &style) const;

  /// Gathers the orientations of atoms 0 to n - 1 (own first, then ghosts).
  void read_orientations(int n);
  Quaternion orientation(int i) const;

  /// The semi-axes of atoms 0 to n - 1.
  std::vector<Vec<3>> semi_axes(int n);

  /// Changes an orientation that was read, and gives all of them back to LAMMPS.
  void set_orientation(int i, const Quaternion &q);
  void write_orientations(int n);

  double memory_usage() const;

 private:
  static constexpr int PER_ORIENTATION = 4, PER_SHAPE = 8, BLOCK = 256;

  std::vector<int> indices;
  std::vector<double> orientations;

  LAMMPS_NS::AtomVecEllipsoid *ellipsoids() const;
  int *first_indices(int n);
};

}  // namespace jamshape
