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
                   ", expected ellipsoid: use 'atom_style ellipsoid', behind 'suffix off' if an "
                   "accelerator adds one, and give every atom a shape.");
  }
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!has_shape(i)) continue;
    double packed[MOST_PER_SHAPE];
    const int size = ellipsoids->pack_border_bonus(1, &i, packed);
    const Quaternion q = orientation(i), found = quaternion(packed + 4);
    const bool is_placed = found.w == q.w && found.i == q.i && found.j == q.j && found.k == q.k;
    if (is_placed && (size == PER_SHAPE || size == PER_SHAPE_WITH_EXPONENTS)) return;
    refuse(lmp, FLERR,
           style + " found " + std::to_string(size) +
               " numbers with the shape of an atom, expected " + std::to_string(PER_SHAPE) +
               " or, with exponents, " + std::to_string(PER_SHAPE_WITH_EXPONENTS) +
               ", with its orientation behind the diameters: use LAMMPS " +
               std::to_string(JAMSHAPE_NEWEST_TESTED) + " or an older one.");
  }
}

Vec<3> ParticleView::semi_axes(int i) const
{
  double packed[MOST_PER_SHAPE];
  packed[1] = packed[2] = packed[3] = 0.0;
  ellipsoids->pack_border_bonus(1, &i, packed);
  return {{packed[1], packed[2], packed[3]}};
}

std::optional<std::array<double, 2>> ParticleView::exponents(int i) const
{
  double packed[MOST_PER_SHAPE];
  if (ellipsoids->pack_border_bonus(1, &i, packed) != PER_SHAPE_WITH_EXPONENTS) return std::nullopt;
  return std::array<double, 2>{packed[PER_SHAPE], packed[PER_SHAPE + 1]};
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
  atom->rmass[i] = 4.0 / 3.0 * M_PI * a[0] * a[1] * a[2];
  ellipsoids->set_shape(i, a[0], a[1], a[2]);  // with the moments of inertia of this mass
}

}  // namespace jamshape
