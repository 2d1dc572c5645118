#pragma once

#include "contact/superellipsoid/superellipsoid.hpp"

#include "pair_contact_of.h"

#include <optional>
#include <string>
#include <vector>

namespace jamshape {

/// pair_style superellipsoid/harmonic; pair_coeff I J epsilon [p]
class PairSuperellipsoidHarmonic : public PairContactOf<SuperellipsoidModel> {
 public:
  using PairContactOf::PairContactOf;

  std::optional<int> director(const Vec<3> &semi_axes, int type) const override;
  bool has_three_axes() const override { return true; }

  void settings(int narg, char **arg) override;
  void coeff(int narg, char **arg) override;
  void write_restart(FILE *fp) override;
  void read_restart(FILE *fp) override;
  void write_restart_settings(FILE *) override {}
  void read_restart_settings(FILE *) override {}

 protected:
  std::string style_name() const override { return "superellipsoid/harmonic"; }
  std::string energy_name() const override { return "epsilon"; }
  std::string coeff_rule() const override { return "'I J epsilon' or 'I I epsilon p'"; }
  std::string without_force() const override { return "coinciding centres"; }
  double exponent(int type) const override;

 private:
  std::vector<double> exponent_of;  // by type, from 1; empty while all are 1

  void read_exponent(char **arg);
};

}  // namespace jamshape
