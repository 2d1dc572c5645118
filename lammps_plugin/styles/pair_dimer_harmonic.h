#pragma once

#include "contact/dimer/dimer.hpp"

#include "pair_contact_of.h"

#include <string>

namespace jamshape {

extern template class PairContactOf<DimerModel>;  // compiled in the .cpp alone

/// pair_style dimer/harmonic; pair_coeff I J k_e
class PairDimerHarmonic : public PairContactOf<DimerModel> {
 public:
  using PairContactOf::PairContactOf;

 protected:
  std::string style_name() const override { return "dimer/harmonic"; }
  std::string without_force() const override { return "coinciding discs"; }
};

}  // namespace jamshape
