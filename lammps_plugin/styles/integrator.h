#pragma once

#include "overdamped_flow.h"

#include <memory>
#include <optional>
#include <string>

namespace jamshape {

/// How a step of LAMMPS was divided, for output. All zero with a method that does not divide it.
struct StepReport {
  double shortest;  // substep of the last step of LAMMPS [time]
  double error;     // largest of its local errors, over the typical overlap
  double stages;    // most force evaluations of one of its substeps
};

/// What a method that chooses its own steps carries from one step of LAMMPS to the next; a restart
/// must bring it back to the last bit.
struct StepState {
  double h;             // substep to try next [time]; 0 before the first
  double error_before;  // of the last substep, over what is allowed
  double rate;          // estimate of the largest relaxation rate
  double margin;        // of that, for stability
  OverdampedFlow::Touching touching;
  LAMMPS_NS::bigint rate_cost, rate_age, touching_age;  // in force evaluations
  LAMMPS_NS::bigint accepted, rejected, forced;         // substeps so far
};

/// Keywords of the fix that only some integrators have.
struct IntegratorOptions {
  std::optional<double> tolerance;
  std::optional<int> stages;
};

/// One step of the equations of motion. A new method is a class of its own and one line in
/// `INTEGRATORS`.
class Integrator {
 public:
  virtual ~Integrator() = default;

  /// From the state at the step before `to`, with forces there, to the state at `to`; forces there
  /// come from LAMMPS.
  virtual void step(OverdampedFlow &flow, LAMMPS_NS::bigint to, double dt) = 0;

  /// Stable while dt times the largest relaxation rate is below this.
  virtual double stability_interval() const = 0;

  /// Displacements per particle that OverdampedFlow keeps between stages.
  virtual int n_registers() const { return 0; }

  /* methods that choose their own steps; the others check the limit of stability */

  virtual StepState *state() { return nullptr; }
  virtual StepReport report() const { return {}; }
  /// Estimates what the first step needs.
  virtual void begin_run(OverdampedFlow & /*flow*/) {}
};

/// Nothing when no integrator has this name. Throws std::invalid_argument with a sentence about
/// options that it does not take.
std::unique_ptr<Integrator> make_integrator(const std::string &name, AffineBox &box,
                                            const IntegratorOptions &options);
std::string integrator_names();

}  // namespace jamshape
