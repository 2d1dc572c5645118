#include "bindings/local_energy_model.hpp"
#include "landscape/stage.hpp"

#include <cstdint>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include <utility>
#include <vector>

namespace jamshape {

namespace {

/// A stage with its scales and initial guesses.
struct PosedStage {
  Stage equation;
  StageUnits units;
  StageLimits limits;
  Eigen::VectorXd guess, other;
};

/// The kinks on which a state is held.
struct StageKinks {
  std::vector<Kink> all;
};

StageEnd solve_stage(LocalEnergyModel &of, const PosedStage &stage,
                     const std::shared_ptr<Factors> &factors, std::size_t n_bonds,
                     const StageKinks &kinks)
{
  for (const auto *part :
       {&stage.equation.drag, &stage.equation.centre, &stage.guess, &stage.other}) {
    require(static_cast<std::size_t>(part->size()) == of.n(),
            "a vector of a stage does not have one number per coordinate.");
    require_finite(*part, "a vector of a stage");
  }
  require_base(of);
  require(!factors || factors->size() == of.n(), "the factors have another number of coordinates.");
  return StageSolver(of, stage.equation, stage.units, stage.limits)
      .solve(stage.guess, stage.other, {factors, n_bonds, kinks.all});
}

nb::object mixed_gradient(LocalEnergyModel &of, const Array1<double> &x,
                          const Array1<double> &gradient, const StageKinks &kinks)
{
  require(x.shape(0) == of.n() && gradient.shape(0) == of.n(),
          "x or the gradient does not have one number per coordinate.");
  require_base(of);
  const Eigen::VectorXd there = vector(x);
  require_finite(there, "x");
  Eigen::VectorXd found = vector(gradient);
  const Displacement at{there.data(), 0.0};
  of.renew_pairs(at);
  mix(kinks.all, of.kinks_at(at, kinks.all, true), found);
  return array_of(found.data(), found.size());
}

double size_of(const StageUnits &units, const Array1<double> &shift, const Array1<double> &force,
               const Array1<double> &drag)
{
  require(shift.shape(0) == force.shape(0) && shift.shape(0) == drag.shape(0),
          "shift, force and drag have different lengths.");
  return units.size(vector(shift), vector(force), vector(drag));
}

void export_settings(nb::module_ &m)
{
  using namespace nb::literals;
  nb::class_<StageUnits>(m, "StageUnits", "Units of the errors of displacements.")
      .def(nb::init<double, double, double, double>(), "force"_a, "energy"_a, "length"_a,
           "n_particles"_a)
      .def_ro("force", &StageUnits::force)
      .def_ro("energy", &StageUnits::energy)
      .def_ro("length", &StageUnits::length)
      .def("size", &size_of, "shift"_a, "force"_a, "drag"_a,
           "Magnitude of a displacement (n,), from the force that causes it and the drag over the\n"
           "time step.");
  nb::class_<StageLimits>(m, "StageLimits")
      .def(
          "__init__",
          [](StageLimits *place, double accuracy, double longest_step, double widest_turn) {
            new (place) StageLimits{accuracy, {longest_step, widest_turn}};
          },
          "accuracy"_a, "longest_step"_a, "widest_turn"_a);
}

void export_kinks(nb::module_ &m)
{
  nb::class_<StageKinks>(m, "StageKinks", "Kinks of the energy on which a state is held.")
      .def(nb::init<>())
      .def("__len__", [](const StageKinks &of) { return of.all.size(); })
      .def_prop_ro(
          "particles",
          [](const StageKinks &of) {
            std::vector<std::pair<std::int64_t, std::int64_t>> found;
            for (const Kink &kink : of.all) found.push_back({kink.pair[0], kink.pair[1]});
            return found;
          },
          "Pairs of particles.")
      .def_prop_ro(
          "weights",
          [](const StageKinks &of) {
            std::vector<double> found;
            for (const Kink &kink : of.all) found.push_back(kink.weight);
            return found;
          },
          "Weights from 0 to 1 of the second of the two slopes.");
}

}  // namespace

void export_stages(nb::module_ &m)
{
  using namespace nb::literals;
  export_settings(m);
  export_kinks(m);
  nb::class_<PosedStage>(m, "Stage",
                         "The equation drag (x - centre) + dU/dx = 0, with x relative to the base.")
      .def(
          "__init__",
          [](PosedStage *place, const Array1<double> &drag, const Array1<double> &centre,
             bool extended, const StageUnits &units, const StageLimits &limits,
             const Array1<double> &guess, const Array1<double> &other) {
            new (place) PosedStage{{vector(drag), vector(centre), extended},
                                   units,
                                   limits,
                                   vector(guess),
                                   vector(other)};
          },
          "drag"_a, "centre"_a, "extended"_a, "units"_a, "limits"_a, "guess"_a, "other"_a);
  nb::class_<StageEnd>(m, "StageEnd")
      .def_prop_ro("x", [](const StageEnd &end) { return array_of(end.x.data(), end.x.size()); })
      .def_prop_ro("sums", [](const StageEnd &end) { return tuple_of(end.sums); })
      .def_prop_ro("factors", [](const StageEnd &end) { return end.found.factors; })
      .def_prop_ro("bonds_of_factors", [](const StageEnd &end) { return end.found.n_bonds; })
      .def_prop_ro("kinks", [](const StageEnd &end) { return StageKinks{end.found.kinks}; })
      .def_ro("evaluations", &StageEnd::evaluations)
      .def_ro("factorisations", &StageEnd::factorisations)
      .def_ro("directions", &StageEnd::directions)
      .def_ro("solved", &StageEnd::solved);
  nb::borrow<nb::class_<LocalEnergyModel>>(nb::type<LocalEnergyModel>())
      .def("solve_stage", &solve_stage, "stage"_a, "factors"_a.none(), "bonds_of_factors"_a,
           "kinks"_a = StageKinks{},
           "Solve a Stage, with factors of an earlier one, the number of bonds at the point of\n"
           "their Hessian, and the kinks on which it ended. Returns a StageEnd.")
      .def("mixed_gradient", &mixed_gradient, "x"_a, "gradient"_a, "kinks"_a,
           "Gradient (n,) of the mixtures on kinks at x, from that at x without them.");
}

}  // namespace jamshape
