#pragma once

#include "contact/contact_block.hpp"
#include "contact/instruction_set.hpp"

namespace jamshape {

/// Finds the contacts of a block. The centres of the bodies and the k_e of the law are ignored in
/// favour of those of the block.
template <class Model, int D>
using FindContacts = void(const typename Model::template Body<D> *bodies,
                          const typename Model::Law &law, ContactBlock<D> &block);

/// The function of a shape that has packs, for an instruction set `of`, if the packs `take` each of
/// the particles beside the first one; none where pairs are evaluated one by one. Those that
/// CHOOSE mark pairs closer than the block's margin as touching.
template <class Model, int D> struct PacksOf {
  static constexpr bool EXIST = false, CHOOSE = false;
};

}  // namespace jamshape
