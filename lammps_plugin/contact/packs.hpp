#pragma once

#include "contact/contact_block.hpp"
#include "contact/instruction_set.hpp"

namespace jamshape {

/// Finds the contacts of a block. Of the bodies centres do not count, and of the law k_e does not,
/// which are the block's.
template <class Model, int D>
using FindContacts = void(const typename Model::template Body<D> *bodies,
                          const typename Model::Law &law, ContactBlock<D> &block);

/// The function of a shape that has packs, `of` a set, for particles each of which they `take`
/// beside the first one; none where pairs go one by one.
template <class Model, int D> struct PacksOf {
  static constexpr bool EXIST = false;
};

}  // namespace jamshape
