#include "contact/spheropolygon/spheropolygon.hpp"

#include "pair_with_sides.h"

#include <string>

namespace jamshape {

namespace {

/// pair_style spheropolygon/harmonic sides one|two [law LAW]; pair_coeff I J k_e [polygon]
class PairSpheropolygonHarmonic : public PairWithSides<SpheropolygonModel> {
 public:
  using PairWithSides::PairWithSides;

  double rim(const Vec<3> &semi_axes, int type) const override
  {
    return SpheropolygonModel::rim(*this->shape_from(semi_axes, type));
  }

 protected:
  std::string without_force() const override { return "overlapping cores"; }
};

const PairStyle<PairSpheropolygonHarmonic> listed;

}  // namespace

}  // namespace jamshape
