// Compiled once for each instruction set, JAMSHAPE_SET.

#include "contact/contact_block.hpp"
#include "contact/math/pack.hpp"
#include "contact/math/pack_functions.hpp"
#include "contact/math/vec.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"

namespace jamshape {
namespace {

template <int D> Vec<D, Pack> axes(const SpherocylinderBody<D> *bodies, const int *index)
{
  Vec<D, Pack> u;
  for (int a = 0; a < D; ++a) u[a] = Pack::from([&](int k) { return bodies[index[k]].axis[a]; });
  return u;
}

/// The pairs of a block from `first` on.
template <int D>
SpherocylinderContact<D, Pack> pairs_of(const SpherocylinderBody<D> *bodies,
                                        const SpherocylinderLaw &law, const ContactBlock<D> &block,
                                        int first)
{
  const int *const i = block.i + first, *const j = block.j + first;
  const auto A = [&](const int *index) {
    return Pack::from([&](int k) { return bodies[index[k]].half_length; });
  };
  const auto R = [&](const int *index) {
    return Pack::from([&](int k) { return bodies[index[k]].radius; });
  };
  SpinePair<D, Pack> pair{{}, {}, A(i), {}, A(j)};
  if (!law.shortcuts || any((pair.A_i > Pack(0.0)) | (pair.A_j > Pack(0.0)))) {
    pair.u_i = axes<D>(bodies, i);
    pair.u_j = axes<D>(bodies, j);
  }
  for (int a = 0; a < D; ++a) pair.r[a] = Pack::load(block.separation[a] + first);
  const SpherocylinderLawOf<Pack> of_lanes{
      {Pack::load(block.k_e + first)}, law.sides, law.shortcuts};
  return {pair, R(i), R(j), of_lanes};
}

}  // namespace

/// Flattened: all called functions are inlined, so that none compiled for this instruction set
/// exists under a name that other files share.
template <InstructionSet SET, int D>
[[gnu::flatten]] void find_rod_contacts(const SpherocylinderBody<D> *bodies,
                                        const SpherocylinderLaw &law, ContactBlock<D> &block)
{
  block.find(
      LANES,
      [&](const ContactBlock<D> &of, int first) {
        return pairs_of<D>(bodies, law, of, first).evaluate_lanes();
      },
      [&](const ContactBlock<D> &of, int first) {
        return pairs_of<D>(bodies, law, of, first).evaluate_shared_lanes();
      });
}

template FindContacts<SpherocylinderModel, 2> find_rod_contacts<InstructionSet::JAMSHAPE_SET, 2>;
template FindContacts<SpherocylinderModel, 3> find_rod_contacts<InstructionSet::JAMSHAPE_SET, 3>;

}  // namespace jamshape
