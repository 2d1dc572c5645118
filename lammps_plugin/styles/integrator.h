#pragma once

#include "overdamped_flow.h"

#include <memory>
#include <optional>
#include <string>

namespace jamshape {

/// Substeps of one step of LAMMPS, for output. All zero for a method without substeps.
struct StepReport {
  double shortest;  // substep of the last step of LAMMPS [time]
  double error;     // largest of its local errors, over the typical overlap
  double stages;    // most force evaluations of one of its substeps
};

/// State of an adaptive method between steps of LAMMPS; a restart must restore it to the last bit.
struct StepState {
  double h;             // next substep to try [time]; 0 before the first
  double error_before;  // error of the last substep, over its tolerance
  double rate;          // estimate of the largest relaxation rate
  double margin;        // safety factor of that rate
  OverdampedFlow::Touching touching;
  LAMMPS_NS::bigint rate_cost, rate_age, touching_age;  // in force evaluations
  LAMMPS_NS::bigint accepted, rejected, forced;         // substeps so far
};

/// Keywords of the fix that only some integrators accept.
struct IntegratorOptions {
  std::optional<double> tolerance;
  std::optional<int> stages;
};

/// One step of the equations of motion. A new method is a class and one line in `INTEGRATORS`.
class Integrator {
 public:
  virtual ~Integrator() = default;

  /// Advances from the state at the step before `to`, with forces there, to the state at `to`,
  /// where LAMMPS computes the forces.
  virtual void step(OverdampedFlow &flow, LAMMPS_NS::bigint to, double dt) = 0;

  /// Stable if dt times the largest relaxation rate is below this.
  virtual double stability_interval() const = 0;

  /// Displacements per particle that OverdampedFlow keeps between stages.
  virtual int n_registers() const { return 0; }

  /* methods that choose their own steps; the others check the limit of stability */

  virtual StepState *state() { return nullptr; }
  virtual StepReport report() const { return {}; }
  /// Makes the estimates needed by the first step.
  virtual void begin_run(OverdampedFlow & /*flow*/) {}

 protected:
  /// Sets the box of a stage, and returns its deformation: that at its time, or, where the box
  /// yields, by the same sum of rates as the particles.
  static Upper set_box(const OverdampedFlow &flow, AffineBox &box, const OverdampedFlow::Move &by);
};

/// Returns null if no integrator has this name. Throws std::invalid_argument with a message about
/// options that it does not accept.
std::unique_ptr<Integrator> make_integrator(const std::string &name, AffineBox &box,
                                            const IntegratorOptions &options);
std::string integrator_names();

}  // namespace jamshape
