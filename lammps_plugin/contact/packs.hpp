#pragma once

#include "contact/contact_block.hpp"
#include "contact/instruction_set.hpp"

#include <type_traits>

namespace jamshape {

/// Finds the contacts of a block. Of the bodies centres do not count, and of the law k_e does not,
/// which are the block's.
template <class Model, int D>
using FindContacts = void(const typename Model::template Body<D> *bodies,
                          const typename Model::Law &law, ContactBlock<D> &block);

/// Of functions that are compiled once for each set, `of_set(set)`, the one for a set that this
/// machine has; none for pairs one by one.
template <class OfSet>
auto compiled_for(InstructionSet set, const OfSet &of_set)
    -> decltype(of_set(std::integral_constant<InstructionSet, InstructionSet::baseline>()))
{
  if (set == InstructionSet::scalar) return nullptr;
#if defined(__x86_64__)
  if (set == InstructionSet::avx2) {
    return of_set(std::integral_constant<InstructionSet, InstructionSet::avx2>());
  }
#endif
  return of_set(std::integral_constant<InstructionSet, InstructionSet::baseline>());
}

/// The function of a shape that has packs, `of` a set, for particles each of which they `take`
/// beside the first one; none where pairs go one by one.
template <class Model, int D> struct PacksOf {
  static constexpr bool EXIST = false;
};

}  // namespace jamshape
