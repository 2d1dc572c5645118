#pragma once

#include "contact/math/upper.hpp"
#include "contact/math/vec.hpp"

#include "pointers.h"

namespace jamshape {

/// The box that a host of constant velocity gradient G carries with it, dx/dt = G x about a fixed
/// point: G = -kappa 1 is the shrinking box of Marschall & Teitel 2018, Eq. 6. Cell and positions
/// follow from the deformation F = exp(G t) since strain 0, never from multiplying step by step: at
/// a rate of 1e-10 one step changes them by 1e-12, and the rounding of a product would add up.
class AffineBox : protected LAMMPS_NS::Pointers {
 public:
  /// Which point of the box stays where it is.
  enum class Reference { CENTER, CORNER };

  /// Another choice of the cell vectors of the same lattice: b + m a and c + p b + n a.
  struct Flip {
    double m, n, p;
    bool is_none() const { return m == 0.0 && n == 0.0 && p == 0.0; }
  };

  /// What a restart must bring back to the last bit.
  struct State {
    double lo[3], hi[3];         // at strain 0
    double xy, xz, yz;           // the same cell's tilt
    Vec<3> stretch_base;         // logarithms of the diagonal of F at step_base
    double base[3], sheared[3];  // its xy, xz, yz, flips apart; integrals of those of G until then
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

  /// At the start of a run from this step: takes the present box as strain 0 unless it is the one
  /// that this left. False where that ends a strain that was reached.
  bool begin_run(LAMMPS_NS::bigint step);
  /// Continues from the present strain if `timestep` has changed; true where it has.
  bool follow_timestep();
  /// Last step that the flow has done: LAMMPS counts those of minimisers, too, in which it rests.
  LAMMPS_NS::bigint reached() const { return reached_step; }
  void reach(LAMMPS_NS::bigint step) { reached_step = step; }
  /// Whether LAMMPS's box is the last one that `set_box` gave it.
  bool is_as_left() const;

  /// Time since strain 0.
  double time(LAMMPS_NS::bigint step) const;
  /// By how much all lengths have shrunk on the mean, -ln(V) / D; the integrals of G_xy, and of
  /// (G_xx - G_yy) / 2.
  double strain(LAMMPS_NS::bigint step) const;
  double shear_strain(LAMMPS_NS::bigint step) const;
  double pure_strain(LAMMPS_NS::bigint step) const;
  /// How fast the flow strains: the largest sum of a row of |G|.
  double speed() const;
  /// Whether it only shrinks or grows the box, evenly.
  bool is_isotropic() const;

  /// F, at a step and at a time after it.
  Upper deformation(LAMMPS_NS::bigint step, double time_after = 0.0) const;
  /// Gives LAMMPS the box of that deformation.
  void set_box(const Upper &deformation);

  /// Flips that bring back a tilt of more than `most` of the edge that it goes along.
  Flip flip_needed(LAMMPS_NS::bigint step, double most) const;
  /// Takes them, and returns what coordinates in the box of strain 0 are to be multiplied with: the
  /// cell at strain 0 stays as it was.
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
  /// LAMMPS counts images modulo this. What to add to coordinates in the box of strain 0 where a
  /// count has begun anew, which flips bring about: each changes the counts of particles that have
  /// left the first image.
  static constexpr double IMAGES = 2.0 * IMGMAX;
  Vec<3> recounted(const Vec<3> &reference, LAMMPS_NS::imageint image) const;
  /// And back.
  Vec<3> reference(const double *x, LAMMPS_NS::imageint image, const Upper &deformation) const;

 private:
  const Reference fixed;
  const int dimension;
  /// LAMMPS's numbers of a box.
  struct Bounds {
    Vec<3> lo, hi;
    double xy, xz, yz;
  };

  State now;
  double time_base;  // since strain 0, at step_base
  LAMMPS_NS::bigint reached_step;
  bool started;
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
  void go_on_from(LAMMPS_NS::bigint step);
  void start_here(LAMMPS_NS::bigint step);
};

}  // namespace jamshape
