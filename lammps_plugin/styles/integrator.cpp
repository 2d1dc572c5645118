#include "integrator.h"

#include <map>

namespace jamshape {

namespace {

/// Two stages, second order (Marschall & Teitel 2018, Sec. II): Euler to the end of the step, then
/// the mean of the rates at both ends.
class Heun : public Integrator {
 public:
  explicit Heun(AffineBox &affine_box) : box(affine_box) {}

  void step(OverdampedFlow &flow, const OverdampedFlow::Stage &from,
            const OverdampedFlow::Stage &to, double dt) override
  {
    flow.begin_step();
    flow.store_rates(from);
    box.set_box(to.step);
    flow.move_by({dt, 1.0, 0.0, from, to});
    flow.evaluate_forces();
    flow.finish_step({dt, 0.5, 0.5, to, to});
  }

  double stability_interval() const override { return 2.0; }

 private:
  AffineBox &box;
};

template <class T> std::unique_ptr<Integrator> make(AffineBox &box)
{
  return std::make_unique<T>(box);
}

const std::map<std::string, std::unique_ptr<Integrator> (*)(AffineBox &)> INTEGRATORS = {
    {"heun", make<Heun>},
};

}  // namespace

std::unique_ptr<Integrator> make_integrator(const std::string &name, AffineBox &box)
{
  const auto found = INTEGRATORS.find(name);
  return found == INTEGRATORS.end() ? nullptr : found->second(box);
}

std::string integrator_names()
{
  std::string names;
  for (const auto &entry : INTEGRATORS) names += (names.empty() ? "" : ", ") + entry.first;
  return names;
}

}  // namespace jamshape
