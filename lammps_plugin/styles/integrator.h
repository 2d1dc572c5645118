#pragma once

#include "overdamped_flow.h"

#include <memory>
#include <string>

namespace jamshape {

/// One step of the equations of motion. A new method is a class of its own and one line in
/// `make_integrator`.
class Integrator {
 public:
  virtual ~Integrator() = default;

  /// From the state at `from`, with forces there, to the state at `to`; forces there come from
  /// LAMMPS.
  virtual void step(OverdampedFlow &flow, const OverdampedFlow::Stage &from,
                    const OverdampedFlow::Stage &to, double dt) = 0;

  /// Stable while dt times the largest relaxation rate is below this.
  virtual double stability_interval() const = 0;
};

/// Nothing when no integrator has this name.
std::unique_ptr<Integrator> make_integrator(const std::string &name, AffineBox &box);
std::string integrator_names();

}  // namespace jamshape
