#include "contact/clump/clump.hpp"

#include "pair_contact_of.h"

#include <string>

namespace jamshape {

namespace {

/// pair_style clump/harmonic [law LAW]; pair_coeff I J k_e [discs]
class PairClumpHarmonic : public PairContactOf<ClumpModel> {
 public:
  using PairContactOf::PairContactOf;

 protected:
  std::string without_force() const override
  {
    return "coinciding discs, or more than 16 pairs of discs that touch";
  }
};

const PairStyle<PairClumpHarmonic> listed;

}  // namespace

}  // namespace jamshape
