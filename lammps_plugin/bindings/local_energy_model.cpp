#include "bindings/local_energy_model.hpp"

#include "contact/shapes.hpp"

#include "bindings/shape.hpp"
#include "landscape/vicinity.hpp"

#include <memory>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/unique_ptr.h>

namespace jamshape {

namespace {

Poses poses_from(const PoseArrays &arrays)
{
  Poses poses;
  const auto fill = [](Poses::Numbers &to, const auto &from) {
    for (std::size_t part = 0, n = from.size() / 2; part < 2; ++part) {
      to[part].assign(from.data() + part * n, from.data() + (part + 1) * n);
    }
  };
  fill(poses.position, arrays.position);
  fill(poses.orientation, arrays.orientation);
  fill(poses.cell, arrays.cell);
  return poses;
}

Displacement checked(const LocalEnergyModel &of, const Array1<double> &x, double strain)
{
  require(x.shape(0) == of.n(), "x has " + std::to_string(x.shape(0)) +
                                    " components, expected one for each of " +
                                    std::to_string(of.n()) + " coordinates.");
  require_base(of);
  require_finite(x, "x");
  require_finite(strain, "strain");
  return {x.data(), strain};
}

nb::object evaluate(LocalEnergyModel &of, const Array1<double> &x, double strain, bool extended)
{
  const Displacement at = checked(of, x, strain);
  of.renew_pairs(at);
  return tuple_of(of.evaluate(at, {extended, true}));
}

std::shared_ptr<Factors> factorise(LocalEnergyModel &of, const Array1<double> &x, double strain,
                                   const Array1<double> &diagonal)
{
  require(diagonal.shape(0) == of.n(), "diagonal does not have one number per coordinate.");
  const Displacement at = checked(of, x, strain);
  of.renew_pairs(at);
  const auto found = of.factorise(at, vector(diagonal));
  require(found != nullptr, "the Hessian has elements that are not finite.");
  return found;
}

void move_to(LocalEnergyModel &of, const Array3<double> &position,
             const Array3<double> &orientation, const Array3<double> &cell)
{
  const PoseArrays poses{position, orientation, cell};
  poses.check(of.n_particles(), of.dimension());
  of.move_to(poses_from(poses));
}

void hold(LocalEnergyModel &of)
{
  require_base(of);
  of.hold();
}

void deform(LocalEnergyModel &of, const Array3<double> &matrix, const Array2<double> &turns)
{
  const std::size_t D = of.dimension();
  require_upper(matrix, D, "matrix");
  require(turns.shape(0) == of.n_particles() && turns.shape(1) == (D == 2 ? 1 : 3),
          "turns do not have the shape (N, 1) in 2D or (N, 3) in 3D.");
  require_finite(turns, "turns");
  require(of.has_held(), "no base is held, expected move_to and hold before.");
  std::vector<long double> rows(D * D);
  for (std::size_t k = 0; k < D * D; ++k) {
    rows[k] = static_cast<long double>(matrix.data()[k]) + matrix.data()[D * D + k];
  }
  of.deform(rows, turns.data());
}

void strain_along(LocalEnergyModel &of, const Array1<double> &axes)
{
  require(axes.shape(0) == static_cast<std::size_t>(of.dimension()),
          "axes do not have one number per dimension.");
  require_finite(axes, "axes");
  of.strain_along({axes.data(), axes.data() + axes.size()});
}

nb::object poses_of(const LocalEnergyModel &about)
{
  const std::size_t D = about.dimension(), N = about.n_particles();
  const Poses &poses = about.poses();
  const std::size_t turns = D == 2 ? 1 : 4;
  NewArray<double> position({2, N, D}), orientation({2, N, turns}), cell({2, D, D});
  const auto fill = [](NewArray<double> &to, const Poses::Numbers &from) {
    std::copy(from[1].begin(), from[1].end(), std::copy(from[0].begin(), from[0].end(), &to[0]));
  };
  fill(position, poses.position);
  fill(orientation, poses.orientation);
  fill(cell, poses.cell);
  return nb::make_tuple(position.release(), orientation.release(), cell.release());
}

nb::object move(LocalEnergyModel &of, const Array1<double> &x, double strain)
{
  of.move(checked(of, x, strain));
  return poses_of(of);
}

nb::object solve(const Factors &factors, const Array2<double> &right, bool nearly)
{
  require(right.shape(1) == factors.size(), "right does not have the length of the matrix.");
  return solutions(right, [&](const auto &side) {
    return nearly ? factors.solve_nearly(side) : factors.solve(side);
  });
}

/// Kept as a separate function: compilers limit inlining by the size of a function.
template <class Model, int D>
[[gnu::noinline]] std::unique_ptr<LocalEnergyModel> local_model_of(const ShapeOf<Model> &of,
                                                                   double skin)
{
  return std::make_unique<VicinityOf<Model, D>>(of.shapes(), of.laws(), skin);
}

/// Gives each shape's class a method that makes the energy of its particles.
void export_constructors()
{
  using namespace nb::literals;
  Shapes::each([](auto model) {
    using Model = decltype(model);
    class_of<Model>().def(
        "local_energy_model",
        [](const ShapeOf<Model> &of, double skin) {
          require(skin > 0.0 && std::isfinite(skin),
                  "skin is " + shown(skin) + ", expected a positive length.");
          return of.in_space([&](auto D) { return local_model_of<Model, D>(of, skin); });
        },
        "skin"_a,
        "The energy about a base, by the displacement of each particle and, if contacts can "
        "rotate\n"
        "it, its rotation over 1 / rotation_length; pairs of surfaces closer than a skin are\n"
        "listed. First of all, move_to a base.");
  });
}

void export_strains()
{
  using namespace nb::literals;
  nb::borrow<nb::class_<LocalEnergyModel>>(nb::type<LocalEnergyModel>())
      .def("strain_along", &strain_along, "axes"_a,
           "From now on coupling and strain_curvature are about the strain of these axes (D,),\n"
           "0 or 1 each; at first of all axes.")
      .def_prop_ro(
          "coupling",
          [](const LocalEnergyModel &of) {
            const Eigen::VectorXd &found = of.coupling();
            return array_of(found.data(), found.size());
          },
          "Derivative (n,) of the gradient with respect to the strain, where a Hessian was last "
          "made;\n"
          "empty before.")
      .def_prop_ro("strain_curvature", &LocalEnergyModel::strain_curvature,
                   "Second derivative of the energy with respect to the strain, there.");
}

}  // namespace

void export_local_energy_model(nb::module_ &m)
{
  using namespace nb::literals;
  nb::class_<Factors>(m, "Factors", "Factors of a positive definite matrix.")
      .def("solve", &solve, "right"_a, "nearly"_a = false,
           "Solve for each row of right (k, n), or nearly, as to precondition iterations.");
  m.attr("LEAST_SHIFT") = LEAST_SHIFT;

  nb::class_<LocalEnergyModel>(m, "LocalEnergyModel", "The energy of a packing about a base.")
      .def("move_to", &move_to, "position"_a, "orientation"_a, "cell"_a,
           "Set the base to these poses, in double-double.")
      .def("move", &move, "x"_a, "strain"_a,
           "Move the base to a nearby point; return its poses in the format of move_to.")
      .def("hold", &hold, "Store the base, from which deform begins.")
      .def("deform", &deform, "matrix"_a, "turns"_a,
           "Move the base to the image of the stored one under an upper triangular matrix (2, D, "
           "D),\n"
           "in double-double, and its particles by rotation vectors (N, 1 or 3).")
      .def_prop_ro(
          "poses", [](const LocalEnergyModel &of) { return poses_of(of); },
          "Poses of the base, in the format of move_to.")
      .def(
          "share",
          [](LocalEnergyModel &of, std::int64_t threads) {
            require_threads(threads);
            of.share(static_cast<std::size_t>(threads));
          },
          "threads"_a, "Set the number of threads of sums over contacts, 1 at first.")
      .def("follow_bodies", &LocalEnergyModel::follow_bodies,
           "From now on rotations in 3D are about the axes of each body at the base, not those of\n"
           "space, and factors solve equations, by iteration where they are incomplete.")
      .def("evaluate", &evaluate, "x"_a, "strain"_a, "extended"_a,
           "Return energy, gradient (n,), derivative with respect to the strain, sum of the\n"
           "magnitudes of bond forces, number of bonds, particles (k, 2) of a pair that crosses "
           "and\n"
           "of one that is unconverged, with k 0 or 1, and the virial (D D,).")
      .def("factorise", &factorise, "x"_a, "strain"_a, "diagonal"_a,
           "Factors of the Hessian in these coordinates plus a diagonal (n,), shifted if it is\n"
           "not positive definite.")
      .def("forget_pairs", &LocalEnergyModel::forget_pairs,
           "Forget all pairs, so that results depend on the base alone, to the last bit.");

  export_strains();
  export_constructors();
}

}  // namespace jamshape
