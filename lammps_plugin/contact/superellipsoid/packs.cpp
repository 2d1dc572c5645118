// Compiled once for each instruction set, JAMSHAPE_SET.

#include "contact/contact_block.hpp"
#include "contact/math/pack.hpp"
#include "contact/math/pack_functions.hpp"
#include "contact/math/vec.hpp"
#include "contact/superellipsoid/superellipsoid.hpp"

namespace jamshape {
namespace {

template <int D> using BodyLanes = SuperellipsoidBody<D, Pack>;

template <int D, class NumberOf>
Pack each(const SuperellipsoidBody<D> *bodies, const int *index, const NumberOf &number_of)
{
  return Pack::from([&](int k) { return number_of(bodies[index[k]]); });
}

/// Sizes only: all that tells whether bodies may touch.
template <int D> BodyLanes<D> sizes_of(const SuperellipsoidBody<D> *bodies, const int *index)
{
  BodyLanes<D> lanes;
  lanes.p = bodies[index[0]].p;
  lanes.p_across = bodies[index[0]].p_across;
  lanes.bounding_radius =
      each<D>(bodies, index, [](const auto &body) { return body.bounding_radius; });
  for (int a = 0; a < D; ++a) {
    lanes.semi_axes[a] =
        each<D>(bodies, index, [&](const auto &body) { return body.semi_axes[a]; });
  }
  return lanes;
}

template <int D>
void add_axes(BodyLanes<D> &lanes, const SuperellipsoidBody<D> *bodies, const int *index)
{
  for (int a = 0; a < D; ++a) {
    for (int b = 0; b < D; ++b) {
      lanes.axis[a][b] = each<D>(bodies, index, [&](const auto &body) { return body.axis[a][b]; });
    }
  }
}

/// Separations of pairs, with the lanes whose bounding spheres touch, and whose centres coincide.
template <int D> struct SeparationLanes {
  Vec<D, Pack> r;
  Mask near, coincident;

  SeparationLanes(const ContactBlock<D> &block, int first, const Pack &reach)
  {
    for (int a = 0; a < D; ++a) r[a] = Pack::load(block.separation[a] + first);
    const Pack distance_sq = norm_sq(r);
    near = distance_sq < reach * reach;
    coincident = near & (distance_sq <= COINCIDENT * reach * COINCIDENT * reach);
  }
};

template <int D> struct PairLanes {
  BodyLanes<D> i, j;
  Vec<D, Pack> r;
  Mask near;
};

/// Whether and where the pairs touch that no plane was found to separate.
template <int D> struct FoundLanes {
  Tangency<D, Pack> at;
  Mask sought, found;
};

/// Tolerance of the last Newton step of a search that only provides a starting point.
inline constexpr double ROUGH = 1e-2;

/// Initial normals: those of the block if it has any that point along r, else those of ellipsoids.
template <int D>
Vec<D, Pack> begin(const PairLanes<D> &pairs, const ContactBlock<D> &block, int first)
{
  const detail::ByNormalOfEllipsoids<D, Pack> ellipsoids(pairs.i, pairs.j, pairs.r);
  Vec<D, Pack> before{};
  for (int a = 0; block.has_starts && a < D; ++a) before[a] = Pack::load(block.start[a] + first);
  const Mask begun = dot(pairs.r, before) > Pack(0.0), anew = pairs.near & !begun;
  const Vec<D, Pack> n = ellipsoids.scaled(before);
  if (!any(anew)) return n;
  Vec<D, Pack> start = ellipsoids.start();
  if (!pairs.i.is_ellipsoid()) detail::newton_in_lanes(ellipsoids, start, ROUGH, anew);
  return chosen(begun, n, start);
}

template <int D>
void end(const Vec<D, Pack> &n, const Mask &near, ContactBlock<D> &block, int first)
{
  for (int a = 0; block.has_starts && a < D; ++a) {
    double *const to = block.start[a] + first;
    select(near, n[a], Pack::load(to)).store(to);
  }
}

template <int D> FoundLanes<D> found_by_ellipsoids(const PairLanes<D> &pairs, Vec<D, Pack> n)
{
  const detail::ByNormalOfEllipsoids<D, Pack> equations(pairs.i, pairs.j, pairs.r);
  const Mask sought = pairs.near & (dot(pairs.r, n) < Pack(1.0));
  const Mask found = detail::newton_in_lanes(equations, n, SHORT_STEP, sought);
  return {equations.tangency(n), sought, found};
}

/// Solves directly with the bodies' own exponents.
template <class Equations, int D>
FoundLanes<D> found_by(const PairLanes<D> &pairs, const Vec<D, Pack> &n)
{
  using Norm = PowerNorm<D, Pack>;
  const auto h_i = Norm::support(pairs.i).at(n), h_j = Norm::support(pairs.j).at(n);
  const Pack scale = dot(pairs.r, n) / (h_i.value + h_j.value);
  const Mask sought = pairs.near & (scale < Pack(1.0));
  const Equations equations(detail::TangencyProblem<D, Pack>::of(pairs.i, pairs.j, pairs.r));
  auto z = equations.start({scale, n, scale * h_i.gradient, scale * h_j.gradient});
  Mask found;
  if constexpr (Equations::MAY_BE_ILL_POSED) {
    detail::Matrix<Equations::M, Pack> matrix{};
    found = detail::newton_in_lanes(equations, z, SHORT_STEP, sought, &matrix);
    found = found & Equations::is_well_posed(matrix);
  } else {
    found = detail::newton_in_lanes(equations, z, SHORT_STEP, sought);
  }
  return {equations.tangency(z), sought, found};
}

template <int D> FoundLanes<D> found_from(const PairLanes<D> &pairs, const Vec<D, Pack> &n)
{
  if (pairs.i.is_ellipsoid()) return found_by_ellipsoids(pairs, n);
  if (detail::is_by_normal(pairs.i)) return found_by<detail::ByNormal<D, Pack>>(pairs, n);
  return found_by<detail::ByPoint<D, Pack>>(pairs, n);
}

template <int D> void add_load(CentralLanes<D, Pack> &lanes, const TangencyLoad<D, Pack> &load)
{
  lanes.energy = load.energy;
  lanes.force = load.force;
  lanes.bond_force = norm(load.force);
}

/// Contacts of discs or spheres.
template <int D>
CentralLanes<D, Pack> round_contacts_of(const SuperellipsoidBody<D> *bodies, double power,
                                        const ContactBlock<D> &block, int first)
{
  const auto radius_of = [](const auto &body) { return body.semi_axes[0]; };
  const Pack R_i = each<D>(bodies, block.i + first, radius_of);
  const Pack R_j = each<D>(bodies, block.j + first, radius_of);
  const SeparationLanes<D> apart(block, first, R_i + R_j);
  const Tangency<D, Pack> at = tangency_of_spheres(apart.r, R_i, R_j);
  CentralLanes<D, Pack> lanes;
  lanes.alone = apart.coincident;
  lanes.touching = (apart.near & (at.scale < Pack(1.0))) | lanes.alone;
  add_load(lanes, {at, apart.r, {Pack::load(block.k_e + first), power}});
  return lanes;
}

template <int D>
ContactLanes<D, Pack> contacts_of(const SuperellipsoidBody<D> *bodies, double power,
                                  ContactBlock<D> &block, int first)
{
  const int *const i = block.i + first, *const j = block.j + first;
  PairLanes<D> pairs{sizes_of(bodies, i), sizes_of(bodies, j), {}, {}};
  const SeparationLanes<D> apart(block, first, pairs.i.bounding_radius + pairs.j.bounding_radius);
  pairs.r = apart.r;
  pairs.near = apart.near;
  ContactLanes<D, Pack> lanes;
  lanes.touching = lanes.alone;
  if (!any(pairs.near)) return lanes;
  add_axes(pairs.i, bodies, i);
  add_axes(pairs.j, bodies, j);
  const FoundLanes<D> of = found_from(pairs, begin(pairs, block, first));
  end(of.at.normal, pairs.near, block, first);
  const Pack gap = gap_of(detail::TangencyProblem<D, Pack>::of(pairs.i, pairs.j, pairs.r), of.at);
  const Mask bounded =
      (gap <= Pack(TangencySearch<D, double>::GAP)) & is_far_below(gap, of.at.scale);
  lanes.alone = apart.coincident | (of.sought & !(of.found & bounded));
  lanes.touching = (of.found & (of.at.scale < Pack(1.0))) | lanes.alone;
  if (!any(lanes.touching)) return lanes;
  const TangencyLoad<D, Pack> load{of.at, pairs.r, {Pack::load(block.k_e + first), power}};
  add_load(lanes, load);
  lanes.torque_i = load.torque_i;
  lanes.torque_j = load.torque_j;
  return lanes;
}

}  // namespace

/// Flattened: all called functions are inlined, so that none compiled for this instruction set
/// exists under a name that other files share.
template <InstructionSet SET, int D>
[[gnu::flatten]] void find_superellipsoid_contacts(const SuperellipsoidBody<D> *bodies,
                                                   const SuperellipsoidLaw &law,
                                                   ContactBlock<D> &block)
{
  if (!block.turns) {
    block.find(LANES, [&](const ContactBlock<D> &of, int first) {
      return round_contacts_of<D>(bodies, law.bond.power, of, first);
    });
    return;
  }
  block.find(LANES, [&](ContactBlock<D> &of, int first) {
    return contacts_of<D>(bodies, law.bond.power, of, first);
  });
}

template FindContacts<SuperellipsoidModel, 2>
    find_superellipsoid_contacts<InstructionSet::JAMSHAPE_SET, 2>;
template FindContacts<SuperellipsoidModel, 3>
    find_superellipsoid_contacts<InstructionSet::JAMSHAPE_SET, 3>;

}  // namespace jamshape
