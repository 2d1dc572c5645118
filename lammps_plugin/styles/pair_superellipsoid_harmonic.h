#pragma once

#include "contact/superellipsoid/superellipsoid.hpp"

#include "pair_contact_of.h"

#include <string>
#include <vector>

namespace jamshape {

extern template class PairContactOf<SuperellipsoidModel>;  // compiled in the .cpp alone

/// pair_style superellipsoid/harmonic; pair_coeff I J epsilon [p]
class PairSuperellipsoidHarmonic : public PairContactOf<SuperellipsoidModel> {
 public:
  using PairContactOf::PairContactOf;

  bool has_three_axes() const override { return true; }

  void coeff(int narg, char **arg) override;
  void init_style() override;
  void write_restart(FILE *fp) override;
  void read_restart(FILE *fp) override;

 protected:
  std::string style_name() const override { return "superellipsoid/harmonic"; }
  std::string settings_rule() const override
  {
    return "no arguments: give exponents with 'pair_coeff I I epsilon p'";
  }
  std::string energy_name() const override { return "epsilon"; }
  std::string coeff_rule() const override { return "'I J epsilon' or 'I I epsilon p'"; }
  std::string more_coefficients(int type) const override;
  std::string without_force() const override { return "coinciding centres"; }
  double exponent(int type) const override;

 private:
  std::vector<double> exponent_of;  // by type, from 1; empty while all are 1

  void read_exponent(char **arg);
};

}  // namespace jamshape
