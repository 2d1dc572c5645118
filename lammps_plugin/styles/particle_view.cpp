#include "particle_view.h"

#include "error.h"
#include "refusal.h"

#include <cmath>
#include <cstring>
#include <typeinfo>

namespace jamshape {

namespace compat {

/// Any object with virtual functions: sufficient to query its class and where it begins.
struct AnyObject {
  virtual ~AnyObject();
};

}  // namespace compat

__attribute__((no_sanitize("undefined"))) LAMMPS_NS::AtomVecEllipsoid *
compat::as_ellipsoids(LAMMPS_NS::AtomVec *style)
{
  auto *const object = reinterpret_cast<AnyObject *>(style);
  if (std::strcmp(typeid(*object).name(), "N9LAMMPS_NS16AtomVecEllipsoidE") != 0) return nullptr;
  return static_cast<LAMMPS_NS::AtomVecEllipsoid *>(dynamic_cast<void *>(object));
}

void ParticleView::find_ellipsoids(const std::string &style)
{
  LAMMPS_NS::AtomVec *const found = atom->style_match("ellipsoid");
  ellipsoids = found ? compat::as_ellipsoids(found) : nullptr;
  if (!ellipsoids) {
    error->all(FLERR,
               style + " found atom_style " + atom->atom_style +
                   ", expected ellipsoid: use 'atom_style ellipsoid' and give every atom a shape.");
  }
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!has_shape(i)) continue;
    double packed[MOST_PER_SHAPE];
    const int size = ellipsoids->pack_border_bonus(1, &i, packed);
    if (size == PER_SHAPE) return;
    refuse(lmp, FLERR,
           style + " found " + std::to_string(size) +
               " numbers with the shape of an atom, expected " + std::to_string(PER_SHAPE) +
               ": write 'atom_style ellipsoid' without further arguments, and give exponents with "
               "'pair_coeff I I epsilon p'.");
  }
}

Vec<3> ParticleView::semi_axes(int i) const
{
  double packed[MOST_PER_SHAPE];
  packed[1] = packed[2] = packed[3] = 0.0;
  ellipsoids->pack_border_bonus(1, &i, packed);
  return {{packed[1], packed[2], packed[3]}};
}

Quaternion ParticleView::orientation(int i) const
{
  double packed[PER_ORIENTATION] = {1.0, 0.0, 0.0, 0.0};
  ellipsoids->pack_comm_bonus(1, &i, packed);
  return quaternion(packed);
}

void ParticleView::set_orientation(int i, const Quaternion &q) const
{
  double packed[PER_ORIENTATION] = {q.w, q.i, q.j, q.k};
  ellipsoids->unpack_comm_bonus(1, i, packed);
}

void ParticleView::set_diameters(int i, const Vec<3> &diameters) const
{
  const Vec<3> a = 0.5 * diameters;
  ellipsoids->set_shape(i, a[0], a[1], a[2]);
  atom->rmass[i] = 4.0 / 3.0 * M_PI * a[0] * a[1] * a[2];
}

}  // namespace jamshape
