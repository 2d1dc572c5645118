#include "contact/dimer/dimer.hpp"

#include "pair_contact_of.h"

#include <string>

namespace jamshape {

namespace {

/// pair_style dimer/harmonic [law LAW]; pair_coeff I J k_e
class PairDimerHarmonic : public PairContactOf<DimerModel> {
 public:
  using PairContactOf::PairContactOf;

 protected:
  std::string without_force() const override { return "coinciding discs"; }
};

const PairStyle<PairDimerHarmonic> listed;

}  // namespace

}  // namespace jamshape
