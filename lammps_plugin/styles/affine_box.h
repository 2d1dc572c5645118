#pragma once

#include "contact/math/upper.hpp"
#include "contact/math/vec.hpp"

#include "pointers.h"

namespace jamshape {

/// The box that a host of constant velocity gradient G carries along, dx/dt = G x about a fixed
/// point: G = -kappa 1 is the shrinking box of Marschall & Teitel 2018, Eq. 6. Cell and positions
/// follow from the deformation F = exp(G t) since strain 0, never from a product of steps: at a
/// rate of 1e-10 one step changes them by 1e-12, and the rounding errors of a product would
/// accumulate.
class AffineBox : protected LAMMPS_NS::Pointers {
 public:
  /// The point of the box that stays fixed.
  enum class Reference { CENTER, CORNER };

  /// Alternative cell vectors of the same lattice: b + m a and c + p b + n a.
  struct Flip {
    double m, n, p;
    bool is_none() const { return m == 0.0 && n == 0.0 && p == 0.0; }
  };

  /// State that a restart must restore to the last bit.
  struct State {
    double lo[3], hi[3];         // at strain 0
    double xy, xz, yz;           // tilt of the same cell
    Vec<3> stretch_base;         // logarithms of the diagonal of F at step_base
    double base[3], sheared[3];  // its xy, xz, yz without flips; integrals of those of G up to then
    Flip flips;                  // since step_base
    Upper rate;                  // G, since then
    double dt;
    LAMMPS_NS::bigint step_base;
  };

  AffineBox(LAMMPS_NS::LAMMPS *lmp, const Upper &gradient, Reference fixed_point);

  const State &state() const { return now; }
  /// State as of LAMMPS's present step, and the time from strain 0 to its `step_base`.
  State saved_state() const;
  double saved_time() const { return time_base; }
  void restore(const State &from, double time_until_base);

  /// Called at the start of a run from this step: takes the present box as strain 0 unless it is
  /// the one left by this flow. Returns false if that ends a strain already reached.
  bool begin_run(LAMMPS_NS::bigint step);
  /// Continues from the present strain if `timestep` has changed; true where it has.
  bool follow_timestep();
  /// Continues from the strain at the start of the next run with another velocity gradient.
  void change_gradient(const Upper &gradient) { next_rate = gradient; }
  /// Last step made by the flow; LAMMPS also counts the steps of minimisers, during which the flow
  /// pauses.
  LAMMPS_NS::bigint reached() const { return reached_step; }
  void reach(LAMMPS_NS::bigint step) { reached_step = step; }
  /// Whether LAMMPS's box is the last one set by `set_box`.
  bool is_as_left() const;

  /// Time since strain 0.
  double time(LAMMPS_NS::bigint step) const;
  /// Mean shrinkage of lengths, -ln(V) / D; the integrals of G_xy, and of (G_xx - G_yy) / 2.
  double strain(LAMMPS_NS::bigint step) const;
  double shear_strain(LAMMPS_NS::bigint step) const;
  double pure_strain(LAMMPS_NS::bigint step) const;
  /// Strain rate of the flow: the largest sum of a row of |G|.
  double speed() const { return speed_of(now.rate); }
  static double speed_of(const Upper &gradient);
  /// Whether it only shrinks or expands the box, isotropically.
  bool is_isotropic() const;

  /// F, at a step or at a time after it.
  Upper deformation(LAMMPS_NS::bigint step, double time_after = 0.0) const;
  /// Sets LAMMPS's box to that of a deformation.
  void set_box(const Upper &deformation);

  /* a box that yields: its rate changes from stage to stage */

  /// Continues from the deformation at a time after a step.
  void go_on_from(LAMMPS_NS::bigint step, double after = 0.0);
  void let_yield() { yields = true; }
  void set_rate(const Upper &gradient) { now.rate = gradient; }
  /// exp(omega) times the deformation that it went on from.
  Upper moved(const Upper &omega) const;
  struct Motion {
    Upper omega;
    Vec<3> sheared;  // integrals of G_xy, G_xz and G_yz
    double h;        // time
  };
  /// Makes the box after a motion the state at a time after a step.
  void settle(LAMMPS_NS::bigint step, double after, const Motion &by);

  /// Flips that remove a tilt of more than `most` of the edge that it goes along.
  Flip flip_needed(LAMMPS_NS::bigint step, double most) const;
  /// Applies them, and returns the factor of coordinates in the box of strain 0: the cell at strain
  /// 0 stays unchanged.
  Upper flip(const Flip &by);

  /// The box of one deformation: positions from coordinates in the box of strain 0 (relative to the
  /// fixed point, unwrapped). `image` holds LAMMPS's periodic image counts.
  template <int D> struct Deformed {
    Vec<D> fixed_point;
    Upper cell_at_start, deformation;

    Vec<D> position(const Vec<D> &reference, LAMMPS_NS::imageint image) const
    {
      const Vec<3> all = image_counts(image);
      Vec<D> images;
      for (int k = 0; k < D; ++k) images[k] = all[k];
      return fixed_point + deformation * (reference - cell_at_start * images);
    }
  };
  template <int D> Deformed<D> deformed(const Upper &deformation) const
  {
    const Vec<3> point = fixed_point();
    Deformed<D> found{{}, cell_at_start(), deformation};
    for (int k = 0; k < D; ++k) found.fixed_point[k] = point[k];
    return found;
  }
  /// LAMMPS counts images modulo this. `recounted` returns the corrected coordinates in the box of
  /// strain 0 after a count has wrapped around, which flips cause: each changes the counts of
  /// particles that have left the first image.
  static constexpr double IMAGES = 2.0 * IMGMAX;
  Vec<3> recounted(const Vec<3> &reference, LAMMPS_NS::imageint image) const;
  /// The inverse of Deformed::position.
  Vec<3> reference(const double *x, LAMMPS_NS::imageint image, const Upper &deformation) const;

 private:
  const Reference fixed;
  const int dimension;
  /// LAMMPS's representation of a box.
  struct Bounds {
    Vec<3> lo, hi;
    double xy, xz, yz;
  };

  State now;
  Upper next_rate;   // G from the start of the next run
  double time_base;  // since strain 0, at step_base
  double late;       // of that base, after step_base: within a step only
  LAMMPS_NS::bigint reached_step;
  bool started, yields;
  Bounds left;

  /// Signed image counts from LAMMPS's packed ones.
  static Vec<3> image_counts(LAMMPS_NS::imageint image)
  {
    return {{static_cast<double>((image & IMGMASK) - IMGMAX),
             static_cast<double>((image >> IMGBITS & IMGMASK) - IMGMAX),
             static_cast<double>((image >> IMG2BITS) - IMGMAX)}};
  }

  Vec<3> fixed_point() const;
  Upper cell_at_start() const;
  Bounds bounds(const Upper &deformation) const;
  Bounds present_bounds() const;
  bool is_in_box(const Bounds &at) const;
  double elapsed(LAMMPS_NS::bigint step) const;
  Vec<3> stretch(double passed) const;
  Upper unflipped(double passed) const;
  Upper flips_in_reference(const Flip &by) const;
  void follow_gradient(LAMMPS_NS::bigint step);
  void start_here(LAMMPS_NS::bigint step);
};

}  // namespace jamshape
