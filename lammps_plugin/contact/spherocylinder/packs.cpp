// Compiled once for each instruction set, JAMSHAPE_SET.

#include "contact/contact_block.hpp"
#include "contact/math/pack.hpp"
#include "contact/math/pack_functions.hpp"
#include "contact/math/vec.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"

namespace jamshape {
namespace {

/// Axes, half lengths and radii of the bodies of a pack.
template <int D> struct BodiesOfPack {
  Vec<D, Pack> axis;
  Pack half_length, radius;

  BodiesOfPack(const SpherocylinderBody<D> *bodies, const int *index)
  {
    using Body = SpherocylinderBody<D>;
    static_assert(offsetof(Body, half_length) == offsetof(Body, axis) + sizeof(Body::axis));
    static_assert(offsetof(Body, radius) == offsetof(Body, half_length) + sizeof(double));
    Pack last[4];
    load_fours([&](int k) { return bodies[index[k]].axis.c + (D - 2); }, last);
    axis[D - 2] = last[0];
    axis[D - 1] = last[1];
    half_length = last[2];
    radius = last[3];
    if constexpr (D == 3) axis[0] = Pack::from([&](int k) { return bodies[index[k]].axis[0]; });
  }
};

/// The laws of the pairs of a block from `first` on.
template <int D>
SpherocylinderLawOf<Pack> laws_of(const SpherocylinderLaw &law, const ContactBlock<D> &block,
                                  int first)
{
  return {{Pack::load(block.k_e + first), law.bond.power}, law.sides, law.shortcuts};
}

/// The pairs of a block from `first` on.
template <int D>
SpherocylinderContact<D, Pack> pairs_of(const SpherocylinderBody<D> *bodies,
                                        const SpherocylinderLaw &law, const ContactBlock<D> &block,
                                        int first)
{
  const BodiesOfPack<D> i(bodies, block.i + first), j(bodies, block.j + first);
  SpinePair<D, Pack> pair{{}, i.axis, i.half_length, j.axis, j.half_length};
  for (int a = 0; a < D; ++a) pair.r[a] = Pack::load(block.separation[a] + first);
  return {pair, i.radius, j.radius + block.margin, laws_of(law, block, first)};
}

/// The same of discs (spheres).
template <int D>
SpherocylinderContact<D, Pack> discs_of(const SpherocylinderBody<D> *bodies,
                                        const SpherocylinderLaw &law, const ContactBlock<D> &block,
                                        int first)
{
  const auto radii = [&](const int *index) {
    return Pack::from([&](int k) { return bodies[index[k]].radius; });
  };
  SpinePair<D, Pack> pair{};
  for (int a = 0; a < D; ++a) pair.r[a] = Pack::load(block.separation[a] + first);
  return {pair, radii(block.i + first), radii(block.j + first) + block.margin,
          laws_of(law, block, first)};
}

}  // namespace

/// Flattened: all called functions are inlined, so that none compiled for this instruction set
/// exists under a name that other files share.
template <InstructionSet SET, int D>
[[gnu::flatten]] void find_rod_contacts(const SpherocylinderBody<D> *bodies,
                                        const SpherocylinderLaw &law, ContactBlock<D> &block)
{
  if (!block.turns) {
    block.find(LANES, [&](const ContactBlock<D> &of, int first) {
      return discs_of<D>(bodies, law, of, first).evaluate_round_lanes();
    });
    return;
  }
  block.find(
      LANES,
      [&](const ContactBlock<D> &of, int first) {
        return pairs_of<D>(bodies, law, of, first).evaluate_lanes();
      },
      [&](const ContactBlock<D> &of, int first) {
        return pairs_of<D>(bodies, law, of, first).evaluate_far_lanes();
      },
      [&](const ContactBlock<D> &of, int first) {
        return pairs_of<D>(bodies, law, of, first).evaluate_shared_lanes();
      });
}

template FindContacts<SpherocylinderModel, 2> find_rod_contacts<InstructionSet::JAMSHAPE_SET, 2>;
template FindContacts<SpherocylinderModel, 3> find_rod_contacts<InstructionSet::JAMSHAPE_SET, 3>;

}  // namespace jamshape
