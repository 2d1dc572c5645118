#pragma once

#include "integrator.h"

namespace jamshape {

/// A step of LAMMPS divided into as many substeps as the accuracy needs. The local error of a
/// substep is the rms, over all particles that a force moves, of the difference of two methods (as
/// a length; rotations times the radius of gyration); the tolerance is `tolerance` times the mean
/// overlap length of the bonds. Forces are stiffness times overlap, so that it is the relative
/// error of typical forces as well. A particle without a bond has no error.
class StepControl : public Integrator {
 public:
  StepControl(AffineBox &affine_box, double tolerance);

  void step(OverdampedFlow &flow, LAMMPS_NS::bigint to, double dt) override;
  StepState *state() override { return &now; }
  StepReport report() const override { return last; }
  void begin_run(OverdampedFlow &flow) override;

 protected:
  /// A substep: `h` from the time `begin` after the step `at` of LAMMPS.
  struct Span {
    const AffineBox &box;
    LAMMPS_NS::bigint at;
    double begin, h;
    bool is_last;  // ends exactly at the next step of LAMMPS
    double z;      // h times the largest relaxation rate, with a margin

    Upper deformation(double after) const { return box.deformation(at, begin + after); }
    Upper from() const { return deformation(0.0); }
    Upper to() const { return is_last ? box.deformation(at + 1) : deformation(h); }
  };

  AffineBox &box;

  /// Error of a sum of rates: of the particles, and of the strain of a box that yields times the
  /// distance of first touch.
  double error_of(OverdampedFlow &flow, const OverdampedFlow::Move &sum) const;

 private:
  const double tolerance;
  StepState now;
  StepReport last;

  /// Tries a substep and returns its error (rms, as a length), infinite if a particle would move
  /// too far. The data that `finish` needs is left in the forces and in the flow.
  virtual double attempt(OverdampedFlow &flow, const Span &span) = 0;
  /// Makes the end of the last substep tried the state.
  virtual void finish(OverdampedFlow &flow, const Span &span) = 0;
  virtual bool has_forces_at_end() const = 0;
  /// The error falls with this power of the substep.
  virtual double order_of_error() const = 0;
  virtual double stages(double z) const = 0;

  double substep(OverdampedFlow &flow, const Span &left);
  Span choose(const Span &left) const;
  double allowed_error(const OverdampedFlow &flow, const Span &span) const;
  double smallest_step() const;
  void refresh(OverdampedFlow &flow);
  void widen_margin(double rate_seen);
  void accept(OverdampedFlow &flow, const Span &span, double error, bool was_rejected);
  void require_progress(const OverdampedFlow &flow, double h) const;
};

}  // namespace jamshape
