// Compiled once for each set of instructions, JAMSHAPE_SET.

#include "contact/contact_block.hpp"
#include "contact/math/pack.hpp"
#include "contact/math/vec.hpp"
#include "contact/superellipsoid/superellipsoid.hpp"

namespace jamshape {
namespace {

template <int D> struct Ellipsoids {
  Vec<D, Pack> axis[D], semi_axes;
  Pack bounding_radius;

  Ellipsoids(const SuperellipsoidBody<D> *bodies, const int *index) :
      bounding_radius(Pack::from([&](int k) { return bodies[index[k]].bounding_radius; }))
  {
    for (int a = 0; a < D; ++a) {
      semi_axes[a] = Pack::from([&](int k) { return bodies[index[k]].semi_axes[a]; });
      for (int b = 0; b < D; ++b) {
        axis[a][b] = Pack::from([&](int k) { return bodies[index[k]].axis[a][b]; });
      }
    }
  }

  Mask is_round() const
  {
    Mask round = semi_axes[1] == semi_axes[0];
    for (int a = 2; a < D; ++a) round = round & (semi_axes[a] == semi_axes[0]);
    return round;
  }

  /// The scale at which they contain a point.
  Pack gauge(const Vec<D, Pack> &y) const
  {
    Pack sum = 0.0;
    for (int a = 0; a < D; ++a) {
      const Pack along = dot(axis[a], y) / semi_axes[a];
      sum += along * along;
    }
    return sqrt(sum);
  }
};

/// Normals to begin with: those of the block where it has any, and they point along r.
template <int D>
Vec<D, Pack> begin(const detail::ByNormalOfEllipsoids<D, Pack> &equations, const Vec<D, Pack> &r,
                   const Mask &near, const ContactBlock<D> &block, int first)
{
  if (!block.has_starts) return equations.start();
  Vec<D, Pack> before;
  for (int a = 0; a < D; ++a) before[a] = Pack::load(block.start[a] + first);
  const Mask begun = dot(r, before) > Pack(0.0);
  const Vec<D, Pack> n = equations.scaled(before);
  return any(near & !begun) ? chosen(begun, n, equations.start()) : n;
}

template <int D>
void end(const Vec<D, Pack> &n, const Mask &near, ContactBlock<D> &block, int first)
{
  for (int a = 0; block.has_starts && a < D; ++a) {
    double *const to = block.start[a] + first;
    select(near, n[a], Pack::load(to)).store(to);
  }
}

template <int D> void add_load(ContactLanes<D, Pack> &lanes, const TangencyLoad<D, Pack> &load)
{
  lanes.energy = load.energy;
  lanes.force = load.force;
  lanes.torque_i = load.torque_i;
  lanes.torque_j = load.torque_j;
  lanes.bond_force = norm(load.force);
}

template <int D>
ContactLanes<D, Pack> contacts_of(const SuperellipsoidBody<D> *bodies, ContactBlock<D> &block,
                                  int first)
{
  Vec<D, Pack> r;
  for (int a = 0; a < D; ++a) r[a] = Pack::load(block.separation[a] + first);
  const Ellipsoids<D> i(bodies, block.i + first), j(bodies, block.j + first);
  const Pack reach = i.bounding_radius + j.bounding_radius, distance_sq = norm_sq(r);
  const Mask near = distance_sq < reach * reach;
  ContactLanes<D, Pack> lanes;
  lanes.touching = lanes.alone;
  if (!any(near)) return lanes;
  lanes.alone = near & (distance_sq <= COINCIDENT * reach * COINCIDENT * reach);
  Mask found = near;
  Tangency<D, Pack> at;
  if (all(i.is_round() & j.is_round())) {
    at = tangency_of_spheres(r, i.semi_axes[0], j.semi_axes[0]);
  } else {
    const detail::ByNormalOfEllipsoids<D, Pack> equations(i, j, r);
    Vec<D, Pack> n = begin(equations, r, near, block, first);
    const Mask sought = near & (dot(r, n) < Pack(1.0));
    found = detail::newton_in_lanes(equations, n, SHORT_STEP, sought);
    end(n, near, block, first);
    at = equations.tangency(n);
    lanes.error = most((j.gauge(r - at.point_i) - at.scale) / at.scale, Pack(0.0));
    const Mask bounded = lanes.error <= Pack(TangencySearch<D, double>::GAP);
    lanes.alone = lanes.alone | (sought & !(found & bounded));
  }
  lanes.touching = (found & (at.scale < Pack(1.0))) | lanes.alone;
  if (!any(lanes.touching)) return lanes;
  add_load(lanes, {at, r, {Pack::load(block.k_e + first)}});
  return lanes;
}

}  // namespace

/// Flattened: whatever is called becomes part of it, and no function of these instructions stands
/// by itself under a name that other files have, too.
template <InstructionSet SET, int D>
[[gnu::flatten]] void find_ellipsoid_contacts(const SuperellipsoidBody<D> *bodies,
                                              const SuperellipsoidLaw &, ContactBlock<D> &block)
{
  block.find(LANES,
             [&](ContactBlock<D> &of, int first) { return contacts_of<D>(bodies, of, first); });
}

template FindContacts<SuperellipsoidModel, 2>
    find_ellipsoid_contacts<InstructionSet::JAMSHAPE_SET, 2>;
template FindContacts<SuperellipsoidModel, 3>
    find_ellipsoid_contacts<InstructionSet::JAMSHAPE_SET, 3>;

}  // namespace jamshape
