#include "particle_view.h"

#include "atom.h"
#include "error.h"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace jamshape {

void ParticleView::require_ellipsoids(const std::string &style) const
{
  if (!atom->ellipsoid_flag) {
    error->all(FLERR,
               style + " found atom_style " + atom->atom_style +
                   ", expected ellipsoid: use 'atom_style ellipsoid' and give every atom a shape.");
  }
  for (int i = 0; i < atom->nlocal; ++i) {
    if (atom->ellipsoid[i] < 0) {
      error->one(FLERR, style + " found atom " + std::to_string(atom->tag[i]) +
                            " without a shape, expected an ellipsoid: list it in the data file's "
                            "Ellipsoids section or use 'set atom ... shape'.");
    }
  }
}

LAMMPS_NS::AtomVecEllipsoid *ParticleView::ellipsoids() const
{
  return reinterpret_cast<LAMMPS_NS::AtomVecEllipsoid *>(atom->avec);
}

int *ParticleView::first_indices(int n)
{
  const int had = static_cast<int>(indices.size());
  if (had < n) {
    indices.resize(n);
    std::iota(indices.begin() + had, indices.end(), had);
  }
  return indices.data();
}

void ParticleView::read_orientations(int n)
{
  resize_closely(orientations, static_cast<std::size_t>(PER_ORIENTATION) * n);
  if (n) ellipsoids()->pack_comm_bonus(n, first_indices(n), orientations.data());
}

Quaternion ParticleView::orientation(int i) const
{
  const double *q = &orientations[static_cast<std::size_t>(PER_ORIENTATION) * i];
  return {q[0], q[1], q[2], q[3]};
}

std::vector<Vec<3>> ParticleView::semi_axes(int n)
{
  std::vector<Vec<3>> axes(n);
  int *const index = first_indices(n);
  double packed[PER_SHAPE * BLOCK];  // of some at a time: all would be most of the memory at work
  for (int begin = 0; begin < n; begin += BLOCK) {
    const int size = std::min(BLOCK, n - begin);
    ellipsoids()->pack_border_bonus(size, index + begin, packed);
    for (int k = 0; k < size; ++k) {
      const double *shape = packed + PER_SHAPE * k + 1;
      axes[begin + k] = {{shape[0], shape[1], shape[2]}};
    }
  }
  return axes;
}

void ParticleView::set_orientation(int i, const Quaternion &q)
{
  double *to = &orientations[static_cast<std::size_t>(PER_ORIENTATION) * i];
  to[0] = q.w;
  to[1] = q.i;
  to[2] = q.j;
  to[3] = q.k;
}

void ParticleView::write_orientations(int n)
{
  if (n) ellipsoids()->unpack_comm_bonus(n, 0, orientations.data());
}

double ParticleView::memory_usage() const
{
  return static_cast<double>(indices.capacity() * sizeof(int) +
                             orientations.capacity() * sizeof(double));
}

}  // namespace jamshape
