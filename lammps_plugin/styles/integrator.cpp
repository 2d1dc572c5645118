#include "integrator.h"

#include "runge_kutta_chebyshev.h"
#include "step_control.h"
#include "text.hpp"

#include <cmath>
#include <map>
#include <stdexcept>

namespace jamshape {

namespace {

constexpr double DEFAULT_TOLERANCE = 1e-4;
constexpr int DEFAULT_STAGES = 200, MOST_STAGES = 1000;

/// Two stages, second order (Marschall & Teitel 2018, Sec. II): an Euler step, then the mean of the
/// rates at both ends.
class Heun : public Integrator {
 public:
  explicit Heun(AffineBox &affine_box) : box(affine_box) {}

  void step(OverdampedFlow &flow, LAMMPS_NS::bigint step, double dt) override
  {
    BoxControl *const control = flow.control();
    if (control) control->hold(step - 1, 0.0);
    OverdampedFlow::Move euler{dt, 0.0, box.deformation(step - 1), box.deformation(step)};
    euler.to = set_box(flow, box, euler);
    flow.start_by(euler);
    flow.evaluate_forces();
    OverdampedFlow::Move mean{0.5 * dt, 0.5 * dt, euler.to, euler.to};
    mean.to = set_box(flow, box, mean);
    flow.finish_step(mean);
    if (control) control->settle(step, 0.0, dt);
  }

  double stability_interval() const override { return 2.0; }

 private:
  AffineBox &box;
};

/// Heun's method with its difference from Euler's as the error estimate: that of Euler's step, so
/// that Heun's is far smaller.
class HeunEuler : public StepControl {
 public:
  using StepControl::StepControl;

  double stability_interval() const override { return 2.0; }

 private:
  static constexpr double STAGES = 2.0;
  Upper tried{};  // deformation of the last attempt

  double order_of_error() const override { return 2.0; }
  double stages(double) const override { return STAGES; }

  double attempt(OverdampedFlow &flow, const Span &span) override
  {
    const double h = span.h;
    OverdampedFlow::Move euler{h, 0.0, span.from(), span.to()};
    euler.to = tried = set_box(flow, box, euler);
    if (!flow.move_by(euler)) return INFINITY;
    flow.evaluate_forces();
    return error_of(flow, {-0.5 * h, 0.5 * h, tried, tried});
  }

  void finish(OverdampedFlow &flow, const Span &span) override
  {
    OverdampedFlow::Move mean{0.5 * span.h, 0.5 * span.h, tried, tried};
    mean.to = set_box(flow, box, mean);
    flow.finish_step(mean);
  }

  bool has_forces_at_end() const override { return false; }
};

/// Second-order Runge-Kutta-Chebyshev: s stages are stable up to about 0.65 s^2 over the largest
/// relaxation rate (Sommeijer, Shampine & Verwer, J. Comput. Appl. Math. 88, 315 (1998)).
class Rkc2 : public StepControl {
 public:
  Rkc2(AffineBox &affine_box, double tolerance, int most_stages) :
      StepControl(affine_box, tolerance), most(most_stages)
  {
  }

  double stability_interval() const override { return RungeKuttaChebyshev::interval(most); }
  int n_registers() const override { return 2; }

 private:
  const int most;
  Upper tried{};  // deformation of the last attempt

  double order_of_error() const override { return 3.0; }
  double stages(double z) const override { return RungeKuttaChebyshev::stages(z, most); }

  double attempt(OverdampedFlow &flow, const Span &span) override
  {
    const RungeKuttaChebyshev method(static_cast<int>(stages(span.z)));
    const double h = span.h;
    Upper reached = span.from();
    for (int j = 1; j <= method.s; ++j) {
      const RungeKuttaChebyshev::Stage &stage = method.stage[j];
      const Upper before = reached;
      reached = j == method.s ? span.to() : span.deformation(stage.c * h);
      OverdampedFlow::Move move{h * stage.of_start, h * stage.of_last_rate, before, reached,
                                stage.of_last,      stage.of_one_before};
      move.to = reached = set_box(flow, box, move);
      if (!flow.move_by(move)) return INFINITY;
      flow.evaluate_forces();
    }
    tried = reached;
    return error_of(flow, {0.4 * h, 0.4 * h, tried, tried, -0.8, 0.0});
  }

  void finish(OverdampedFlow &flow, const Span &) override
  {
    flow.finish_step({0.0, 0.0, tried, tried, 1.0, 0.0});
  }

  bool has_forces_at_end() const override { return true; }
};

/* ---------------------------------------------------------------------- */

double tolerance_of(const IntegratorOptions &options)
{
  const double tolerance = options.tolerance.value_or(DEFAULT_TOLERANCE);
  if (!(tolerance >= 1e-12 && tolerance <= 0.1)) {
    throw std::invalid_argument("tolerance " + shown(tolerance) +
                                ", expected a number from 1e-12 to 0.1.");
  }
  return tolerance;
}

void refuse_stages(const IntegratorOptions &options)
{
  if (options.stages)
    throw std::invalid_argument("stages without integrator rkc2: leave it out or use rkc2.");
}

std::unique_ptr<Integrator> make_heun(AffineBox &box, const IntegratorOptions &options)
{
  refuse_stages(options);
  if (options.tolerance) {
    throw std::invalid_argument("tolerance with integrator heun, expected heun/adaptive or rkc2: "
                                "leave it out or use these.");
  }
  return std::make_unique<Heun>(box);
}

std::unique_ptr<Integrator> make_heun_euler(AffineBox &box, const IntegratorOptions &options)
{
  refuse_stages(options);
  return std::make_unique<HeunEuler>(box, tolerance_of(options));
}

std::unique_ptr<Integrator> make_rkc2(AffineBox &box, const IntegratorOptions &options)
{
  const int stages = options.stages.value_or(DEFAULT_STAGES);
  if (stages < 2 || stages > MOST_STAGES) {
    throw std::invalid_argument("stages " + std::to_string(stages) + ", expected from 2 to " +
                                std::to_string(MOST_STAGES) + ".");
  }
  return std::make_unique<Rkc2>(box, tolerance_of(options), stages);
}

const std::map<std::string, std::unique_ptr<Integrator> (*)(AffineBox &, const IntegratorOptions &)>
    INTEGRATORS = {
        {"heun", make_heun},
        {"heun/adaptive", make_heun_euler},
        {"rkc2", make_rkc2},
};

}  // namespace

Upper Integrator::set_box(const OverdampedFlow &flow, AffineBox &box,
                          const OverdampedFlow::Move &by)
{
  BoxControl *const control = flow.control();
  const Upper to = control ? control->moved(by.stored, by.present, by.last, by.before) : by.to;
  box.set_box(to);
  return to;
}

std::unique_ptr<Integrator> make_integrator(const std::string &name, AffineBox &box,
                                            const IntegratorOptions &options)
{
  const auto found = INTEGRATORS.find(name);
  return found == INTEGRATORS.end() ? nullptr : found->second(box, options);
}

std::string integrator_names()
{
  std::string names;
  for (const auto &entry : INTEGRATORS) names += (names.empty() ? "" : ", ") + entry.first;
  return names;
}

}  // namespace jamshape
