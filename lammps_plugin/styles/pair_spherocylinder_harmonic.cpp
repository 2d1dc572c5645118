#include "contact/spherocylinder/spherocylinder.hpp"

#include "pair_with_sides.h"

namespace jamshape {

namespace {

/// pair_style spherocylinder/harmonic sides one|two [law LAW]; pair_coeff I J k_e
class PairSpherocylinderHarmonic : public PairWithSides<SpherocylinderModel> {
 public:
  using PairWithSides::PairWithSides;
};

const PairStyle<PairSpherocylinderHarmonic> listed;

}  // namespace

}  // namespace jamshape
