#pragma once

#include "compute.h"
#include "pair_contact.h"

#include <vector>

namespace jamshape {

/// compute ID all packing
///
/// Global vector, all intensive:
///
///    1 phi       packing fraction
///    2 u         energy density U / L^d
///    3 p         pressure, trace of the virial / (d L^d)
///    4 z         bonds per non-rattler, in the plane a side-to-side contact counted as two
///    5 S_2       nematic order (2D: Marschall & Teitel Eq. 16; 3D: largest eigenvalue of Q)
///    6 S_4       tetratic order (2D: Eq. 16; 3D: mean P_4 about the nematic director)
///    7 fmax      largest net force on a particle over the mean bond force
///    8 frms      root mean square of the same
///    9 z_single  contacts per non-rattler, one however many bonds it has
///   10 rattlers  their number
///   11 bonds     the number of all bonds, counted as in z
///   12 overlap   largest overlap 1 - r/d
///   13 tmax      largest net torque over mean bond force times the particle's radius of gyration
///   14 C_4       cubatic order (Yuan et al. 2019, Eq. 7) of shapes with three axes, in 3D, else 0;
///                directions tried are the axes of all particles, or of about 512 of many
///   15 n_1       normal stress difference p_xx - p_yy of the pressure tensor, virial / L^d
///   16 p_xy      sum of r_y f_x over contacts / L^d: conjugate to shear of x along y, and
///                r_x f_y where torques balance. The shear stress of rheology is -p_xy
///   17 sigma     deviatoric stress in the plane of x and y, ((n_1 / 2)^2 + p_xy^2)^(1/2)
///   18 mu        sigma / p
///   19 p_xz
///   20 p_yz
///   21 n_2       p_yy - p_zz; 0 in 2D
///   22 director  angle of the nematic director to x in 2D, in (-pi / 2, pi / 2]; 0 in 3D
class ComputePacking : public LAMMPS_NS::Compute {
 public:
  ComputePacking(LAMMPS_NS::LAMMPS *lmp, int narg, char **arg);
  ~ComputePacking() override;

  void init() override;
  void compute_vector() override;

 private:
  static constexpr int N_VALUES = 22;
  PairContact *pair;  // as of this call; another pair_style deletes it

  double sum(double mine) const;
  double largest(double mine) const;
  void compute_density_and_stress();
  void compute_order();
  void compute_cubatic_order();
  void compute_contacts(const std::vector<LocalBond> &bonds);
  void count_contacts(const std::vector<LocalBond> &bonds);
  void compute_residuals(double mean_bond_force);
};

}  // namespace jamshape
