#include "contact/superellipsoid/superellipsoid.hpp"

#include "domain.h"
#include "pair_contact_of.h"

#include <array>
#include <string>

namespace jamshape {

namespace {

/// pair_style superellipsoid/harmonic [law LAW]; pair_coeff I J epsilon [p]
class PairSuperellipsoidHarmonic : public PairContactOf<SuperellipsoidModel> {
 public:
  using PairContactOf::PairContactOf;

  bool has_three_axes() const override { return true; }

 protected:
  std::string settings_rule() const override
  {
    return "'law LAW' or no arguments: give exponents with 'pair_coeff I I epsilon p'";
  }
  std::string energy_name() const override { return "epsilon"; }
  std::string without_force() const override { return "coinciding centres"; }
  std::array<double, 2> exponents(int type) const override
  {
    const auto its = SuperellipsoidForm::from(form(type), domain->dimension);
    return {2.0 * its->p, 2.0 * its->p_across};
  }
};

const PairStyle<PairSuperellipsoidHarmonic> listed;

}  // namespace

}  // namespace jamshape
