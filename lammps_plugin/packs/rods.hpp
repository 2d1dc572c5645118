#pragma once

#include "contact/contact_block.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"

#include "packs/instruction_set.hpp"
#include "packs/packs_of.hpp"

namespace jamshape {

/// Compiled in rods.cpp for each set.
template <InstructionSet SET, int D> FindContacts<SpherocylinderModel, D> find_rod_contacts;

template <int D> struct PacksOf<SpherocylinderModel, D> {
  static constexpr bool EXIST = true;

  static FindContacts<SpherocylinderModel, D> *of(InstructionSet set)
  {
    if (set == InstructionSet::scalar) return nullptr;
#if defined(__x86_64__)
    if (set == InstructionSet::avx2) return find_rod_contacts<InstructionSet::avx2, D>;
#endif
    return find_rod_contacts<InstructionSet::baseline, D>;
  }
};

}  // namespace jamshape
