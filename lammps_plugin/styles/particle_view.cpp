#include "particle_view.h"

#include "atom.h"
#include "error.h"
#include "refusal.h"

#include <cmath>

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
      refuse(lmp, FLERR,
             style + " found atom " + std::to_string(atom->tag[i]) +
                 " without a shape, expected an ellipsoid: list it in the data file's "
                 "Ellipsoids section or use 'set atom ... shape'.");
    }
  }
}

LAMMPS_NS::AtomVecEllipsoid *ParticleView::ellipsoids() const
{
  return reinterpret_cast<LAMMPS_NS::AtomVecEllipsoid *>(atom->avec);
}

Vec<3> ParticleView::semi_axes(int i) const
{
  double packed[PER_SHAPE];
  ellipsoids()->pack_border_bonus(1, &i, packed);
  return {{packed[1], packed[2], packed[3]}};
}

Quaternion ParticleView::orientation(int i) const
{
  double packed[PER_ORIENTATION];
  ellipsoids()->pack_comm_bonus(1, &i, packed);
  return quaternion(packed);
}

void ParticleView::set_orientation(int i, const Quaternion &q) const
{
  double packed[PER_ORIENTATION] = {q.w, q.i, q.j, q.k};
  ellipsoids()->unpack_comm_bonus(1, i, packed);
}

void ParticleView::set_diameters(int i, const Vec<3> &diameters) const
{
  const Vec<3> a = 0.5 * diameters;
  ellipsoids()->set_shape(i, a[0], a[1], a[2]);
  atom->rmass[i] = 4.0 / 3.0 * M_PI * a[0] * a[1] * a[2];
}

}  // namespace jamshape
