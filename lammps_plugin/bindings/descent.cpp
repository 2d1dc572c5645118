#include "landscape/descent.hpp"

#include "bindings/local_energy_model.hpp"

#include <string>

namespace jamshape {

namespace {

const char *name_of(DescentOutcome outcome)
{
  switch (outcome) {
    case DescentOutcome::CONVERGED:
      return "converged";
    case DescentOutcome::UNJAMMED:
      return "unjammed";
    case DescentOutcome::STALLED:
      return "stalled";
    default:
      return "exhausted";
  }
}

nb::object tuple_of(const DescentRow &row)
{
  return nb::make_tuple(row.seconds, row.evaluations, row.residual, row.energy_density);
}

DescentEnd descend(LocalEnergyModel &of, const DescentStop &stop, double shift,
                   const nb::callable &tell)
{
  require_base(of);
  require(shift > 0.0 && std::isfinite(shift), "the shift is not a positive number.");
  Descent descent(of, stop, shift);
  descent.tell = [&](const DescentRow &row) { tell(tuple_of(row)); };
  return descent.run();
}

double part_within(const LocalEnergyModel &of, const Array1<double> &x, double longest,
                   double widest)
{
  require_base(of);
  require(x.shape(0) == of.n(), "x does not have one number per coordinate.");
  require_finite(x, "x");
  require(longest > 0.0 && widest > 0.0, "longest_step or widest_turn is not positive.");
  return of.part_within(x.data(), {longest, widest});
}

/// Newton's equations at the base of a local energy model, which Python keeps alive.
class PosedNewton {
 public:
  PosedNewton(LocalEnergyModel &of, double shift) : about(of), system(of, shift)
  {
    require(shift > 0.0 && std::isfinite(shift), "the shift is not a positive number.");
  }

  void prepare()
  {
    require_base(about);
    const Eigen::VectorXd origin = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(about.n()));
    about.renew_pairs({origin.data(), 0.0});
    system.prepare();
    is_prepared = true;
  }

  nb::object coupling() const
  {
    require(is_prepared, "the equations are not prepared, expected prepare before.");
    return array_of(about.coupling().data(), about.n());
  }

  nb::object solve(const Array2<double> &right, double accuracy)
  {
    require(is_prepared, "the equations are not prepared, expected prepare before.");
    require(right.shape(1) == about.n(), "right does not have one number per coordinate.");
    require_finite(right, "right");
    return solutions(right, [&](const auto &side) { return system.solve(side, accuracy); });
  }

  void learn(double part, bool has_closed) { system.learn(part, has_closed); }
  double shift() const { return system.shift; }

 private:
  LocalEnergyModel &about;
  NewtonSystem system;
  bool is_prepared = false;
};

}  // namespace

void export_descent(nb::module_ &m)
{
  using namespace nb::literals;
  nb::class_<DescentStop>(m, "DescentStop")
      .def(
          "__init__",
          [](DescentStop *place, double tolerance, double lowest, std::int64_t evaluations,
             double seconds, double rounding, std::int64_t patience, double newton_below,
             bool is_near, double longest_step, double widest_turn) {
            new (place) DescentStop{tolerance,    lowest,   evaluations,
                                    seconds,      rounding, patience,
                                    newton_below, is_near,  {longest_step, widest_turn}};
          },
          "tolerance"_a, "lowest"_a, "evaluations"_a, "seconds"_a, "rounding"_a, "patience"_a,
          "newton_below"_a, "is_near"_a, "longest_step"_a, "widest_turn"_a);
  nb::class_<DescentEnd>(m, "DescentEnd")
      .def_prop_ro("outcome", [](const DescentEnd &end) { return name_of(end.outcome); })
      .def_prop_ro("sums", [](const DescentEnd &end) { return tuple_of(end.sums); })
      .def_prop_ro("rows",
                   [](const DescentEnd &end) {
                     nb::list rows;
                     for (const DescentRow &row : end.rows) rows.append(tuple_of(row));
                     return rows;
                   })
      .def_ro("evaluations", &DescentEnd::evaluations)
      .def_ro("factorisations", &DescentEnd::factorisations)
      .def_ro("products", &DescentEnd::products);
  nb::class_<PosedNewton>(
      m, "NewtonSystem",
      "The equations (H + shift) x = right at the base of a local energy model, with a shift that\n"
      "makes the Hessian H positive definite.")
      .def(nb::init<LocalEnergyModel &, double>(), "local_model"_a, "shift"_a,
           nb::keep_alive<1, 2>())
      .def("prepare", &PosedNewton::prepare, "Take the Hessian at the base.")
      .def_prop_ro("coupling", &PosedNewton::coupling,
                   "(n,) derivative of the gradient with respect to the strain.")
      .def("solve", &PosedNewton::solve, "right"_a, "accuracy"_a,
           "Solve for each row of right (k, n), to this relative accuracy.")
      .def("learn", &PosedNewton::learn, "part"_a, "has_closed"_a,
           "Lower the shift after a step taken as a whole, raise it if a small part was. With"
           " complete factors a step that a closing contact stopped counts as a whole.")
      .def_prop_ro("shift", &PosedNewton::shift);
  nb::borrow<nb::class_<LocalEnergyModel>>(nb::type<LocalEnergyModel>())
      .def("part_within", &part_within, "x"_a, "longest_step"_a, "widest_turn"_a,
           "The fraction of a step (n,), at most 1, that keeps every particle within these bounds.")
      .def("descend", &descend, "stop"_a, "shift"_a, "tell"_a,
           "Minimise the energy at fixed box by L-BFGS and Newton's method, with this initial "
           "shift\n"
           "of the Hessian; the base moves along. tell(row) is called from time to time with\n"
           "(seconds, evaluations, residual, energy density). Returns a DescentEnd.");
}

}  // namespace jamshape
