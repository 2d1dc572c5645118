#pragma once

#include "contact/spherocylinder/spherocylinder.hpp"

#include "pair_contact_of.h"

#include <string>

namespace jamshape {

extern template class PairContactOf<SpherocylinderModel>;  // compiled in the .cpp alone

/// pair_style spherocylinder/harmonic sides one|two; pair_coeff I J k_e
class PairSpherocylinderHarmonic : public PairContactOf<SpherocylinderModel> {
 public:
  using PairContactOf::PairContactOf;

  /// The lever arm of the single bond jumps from end to end of parallel rods.
  bool has_smooth_forces() const override { return sides == Sides::TWO; }

  void settings(int narg, char **arg) override;
  void write_restart(FILE *fp) override;
  void read_restart(FILE *fp) override;
  void write_restart_settings(FILE *fp) override;
  void read_restart_settings(FILE *fp) override;

 protected:
  std::string style_name() const override { return "spherocylinder/harmonic"; }
};

}  // namespace jamshape
