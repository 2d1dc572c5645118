#pragma once

#include "affine_box.h"
#include "fix.h"
#include "integrator.h"
#include "overdamped_flow.h"

#include <memory>
#include <string>

namespace jamshape {

/// fix ID all overdamped/affine drag k_d [compress kappa] [shear gdot] [pure edot]
///     [gradient xx xy yx yy | xx xy xz yx yy yz zx zy zz] [flip F]
///     [pressure iso START STOP] [stress xx|yy|zz|xy|xz|yz P] [tbox T]
///     [integrator NAME] [tolerance T] [stages MAX] [reference center|corner] [check N]
/// fix_modify ID [compress kappa] [shear gdot] [pure edot] [gradient ...], from the next run on
///
/// Overdamped motion on a substrate that moves affinely with the box, with the sum of the specified
/// velocity gradients: -kappa 1 (Marschall & Teitel 2018, Eqs. 6-14), G_xy = gdot (Marschall, Keta,
/// Olsson & Teitel, Phys. Rev. Lett. 122, 188002), G_xx = -G_yy = edot, or any without entries
/// below the diagonal. Components that `pressure` or `stress` control follow the stress of the
/// contacts instead (BoxControl); targets may be v_name. The box switches to other cell vectors
/// when its tilt exceeds the fraction F of an edge. Global vector: time since strain 0, strain
/// (mean shrinkage of lengths), largest relaxation rate, largest stable time step, dissipated
/// power, force evaluations, list rebuilds inside steps, largest difference of the stages of the
/// last step; of adaptive integrators: accepted, rejected and forced substeps, the next substep,
/// and of the last step of LAMMPS the shortest substep, largest local error and most stages; the
/// mean overlap length that errors are relative to; then the strains of simple and of pure shear,
/// the mean rotation of particles about z, and the power of torques on the rotation due to the host
/// alone; of a box that yields, its time and the viscosity of the host, k_d d^2.
class FixOverdampedAffine : public LAMMPS_NS::Fix {
 public:
  FixOverdampedAffine(LAMMPS_NS::LAMMPS *lmp, int narg, char **arg);
  ~FixOverdampedAffine() override;

  int setmask() override;
  void init() override;
  void setup(int vflag) override;
  void setup_post_neighbor() override;
  void post_neighbor() override;
  void min_post_neighbor() override;
  void pre_exchange() override;
  void post_run() override;
  void initial_integrate(int vflag) override;
  void final_integrate() override;
  double compute_vector(int n) override;
  int modify_param(int narg, char **arg) override;
  double memory_usage() override;

  void write_restart(FILE *fp) override;
  void restart(char *buf) override;

  void grow_arrays(int nmax) override;
  void copy_arrays(int from, int to, int delflag) override;
  void set_arrays(int i) override;
  int pack_exchange(int i, double *buf) override;
  int unpack_exchange(int i, double *buf) override;
  int pack_restart(int i, double *buf) override;
  void unpack_restart(int i, int nth) override;
  int size_restart(int i) override;
  int maxsize_restart() override;
  int pack_forward_comm(int n, int *list, double *buf, int pbc_flag, int *pbc) override;
  void unpack_forward_comm(int n, int first, double *buf) override;

 private:
  std::unique_ptr<AffineBox> box;
  std::unique_ptr<BoxControl> control;  // null if no component of the stress is controlled
  std::unique_ptr<OverdampedFlow> flow;
  std::unique_ptr<Integrator> integrator;
  LAMMPS_NS::bigint check_every, next_check;
  double largest_rate, largest_tilt;
  bool holds_volume;
  bool warned, was_told, running, inside_step;
  bool has_begun;               // in the present run
  LAMMPS_NS::bigint next_look;  // for changes by other fixes

  struct Command;
  Command read(int narg, char **arg);
  int read_flow(int k, int narg, char **arg, Command &to) const;
  int read_control(int k, int narg, char **arg);
  Upper read_gradient(char **arg) const;
  double number(const char *text) const;
  void read_option(const std::string &keyword, const char *text, Command &to);
  void make_parts(const Command &of);
  void require_no_trace(const Upper &gradient) const;
  void make_control(const Command &of);
  void need_virial(LAMMPS_NS::bigint step);
  void follow_stress(LAMMPS_NS::bigint step);
  void tell_what_this_is();
  [[noreturn]] void fail(const std::string &found_and_expected) const;
  void begin_run(LAMMPS_NS::bigint step);
  void require_alone() const;
  void take_up(LAMMPS_NS::bigint from);
  void require_timestep() const;
  void require_strain(double strain) const;
  void require_cell(const Upper &gradient) const;
  void ask_for_flip();
  void tell_what_is_left_out();
  double present_rate() const;
  double largest_stable_dt() const;
  double of_substeps(int n) const;
  void check_stability(LAMMPS_NS::bigint step);
};

}  // namespace jamshape
