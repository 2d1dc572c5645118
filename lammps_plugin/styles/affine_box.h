#pragma once

#include "contact/math/vec.hpp"

#include "pointers.h"

namespace jamshape {

/// The shrinking box (Marschall & Teitel 2018, Eq. 6): dL/dt = -kappa L towards a fixed point.
/// Edges and positions follow from the absolute strain kappa t, never from multiplying step by
/// step: at kappa = 1e-10 one step changes L by 1e-12, and the rounding of a product would add up.
class AffineBox : protected LAMMPS_NS::Pointers {
 public:
  /// Which point of the box stays where it is.
  enum class Reference { CENTER, CORNER };

  /// What a restart must bring back to the last bit.
  struct State {
    double lo[3], hi[3];  // at strain 0
    double strain_base;   // strain at step_base
    double rate, dt;      // since then
    LAMMPS_NS::bigint step_base;
  };

  AffineBox(LAMMPS_NS::LAMMPS *lmp, double kappa, Reference fixed_point);

  const State &state() const { return now; }
  void restore(const State &from);

  /// At the start of a run: takes the present box as strain 0 unless it is the box of the present
  /// strain, and goes on from the present strain when the rate or the time step changed.
  void begin_run();

  /// Time since the rate or the time step last changed.
  double time(LAMMPS_NS::bigint step) const;
  double strain(LAMMPS_NS::bigint step) const;
  /// L / L(strain 0), at a step and at a time after it.
  double scale(LAMMPS_NS::bigint step) const;
  double scale(LAMMPS_NS::bigint step, double time_after) const;
  /// Gives LAMMPS the box of that scale.
  void set_box(double scale);

  /// The box of one scale: positions from coordinates in the box of strain 0 (relative to the fixed
  /// point, unwrapped). `image` holds LAMMPS's periodic image counts.
  template <int D> struct Scaled {
    Vec<D> fixed_point, edge_at_start;
    double scale;

    Vec<D> position(const Vec<D> &reference, LAMMPS_NS::imageint image) const
    {
      const Vec<3> images = image_counts(image);
      Vec<D> x;
      for (int k = 0; k < D; ++k) {
        x[k] = fixed_point[k] + scale * (reference[k] - images[k] * edge_at_start[k]);
      }
      return x;
    }
  };
  template <int D> Scaled<D> scaled(double scale) const
  {
    Scaled<D> found{{}, {}, scale};
    for (int k = 0; k < D; ++k) {
      found.fixed_point[k] = fixed_point(k);
      found.edge_at_start[k] = edge_at_start(k);
    }
    return found;
  }
  /// And back.
  Vec<3> reference(const double *x, LAMMPS_NS::imageint image, double scale) const;

 private:
  const Reference fixed;
  const int dimension;
  State now;
  bool started;

  /// Signed image counts from LAMMPS's packed ones.
  static Vec<3> image_counts(LAMMPS_NS::imageint image)
  {
    return {{static_cast<double>((image & IMGMASK) - IMGMAX),
             static_cast<double>((image >> IMGBITS & IMGMASK) - IMGMAX),
             static_cast<double>((image >> IMG2BITS) - IMGMAX)}};
  }

  double fixed_point(int k) const
  {
    return fixed == Reference::CENTER ? 0.5 * (now.lo[k] + now.hi[k]) : now.lo[k];
  }
  double edge_at_start(int k) const { return now.hi[k] - now.lo[k]; }
  void edges(double scale, double *lo, double *hi) const;
};

}  // namespace jamshape
