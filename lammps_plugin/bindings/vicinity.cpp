#include "bindings/shape.hpp"
#include "bindings/shapes.hpp"
#include "landscape/stage.hpp"

#include <nanobind/stl/shared_ptr.h>

namespace jamshape {

namespace {

/// Poses in the plane, each number a double and its small rest.
struct PoseArrays {
  const Array3<double> &position;     // (2, N, 2)
  const Array3<double> &orientation;  // (2, N, 1)
  const Array2<double> &edges;        // (2, 2)

  Poses sum() const
  {
    const auto added = [](const double *from, std::size_t size) {
      std::vector<long double> sum(from, from + size / 2);
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += from[sum.size() + k];
      return sum;
    };
    const std::vector<long double> box = added(edges.data(), edges.size());
    return {added(position.data(), position.size()),
            added(orientation.data(), orientation.size()),
            {{box[0], box[1]}}};
  }
};

/// What coordinates are, as they come from Python.
struct CoordinateArrays {
  const Array2<std::int64_t> &column;     // (N, 3)
  const Array1<double> &rotation_length;  // (N,)
  const Array1<double> &turning_radius;   // (N,)

  Coordinates read(std::size_t N) const
  {
    require(column.shape(0) == N && column.shape(1) == 3 && rotation_length.shape(0) == N &&
                turning_radius.shape(0) == N,
            "column, rotation_length and turning_radius have no shapes (N, 3), (N,) and (N,).");
    require_finite(rotation_length, "rotation_length");
    require_finite(turning_radius, "turning_radius");
    const std::int64_t *const first = column.data(), *const last = first + column.size();
    std::vector<double> per_length;
    for (std::size_t i = 0; i < N; ++i) {
      const double length = rotation_length.data()[i];
      per_length.push_back(length > 0.0 ? 1.0 / length : 0.0);
    }
    const double *const radius = turning_radius.data();
    return {number_of_columns(first, last), {first, last}, per_length, {radius, radius + N}};
  }

 private:
  /// Throws unless each of so many coordinates is a column of one particle.
  static std::size_t number_of_columns(const std::int64_t *first, const std::int64_t *last)
  {
    std::vector<std::int64_t> numbers;
    std::copy_if(first, last, std::back_inserter(numbers), [](std::int64_t c) { return c != -1; });
    std::sort(numbers.begin(), numbers.end());
    for (std::size_t n = 0; n < numbers.size(); ++n) {
      require(numbers[n] == static_cast<std::int64_t>(n),
              "column does not number the coordinates, expected each of 0, 1, ... once, or -1.");
    }
    return numbers.size();
  }
};

void check_poses(const PoseArrays &poses, std::size_t N)
{
  const auto has_shape = [&](const Array3<double> &of, std::size_t columns) {
    return of.shape(0) == 2 && of.shape(1) == N && of.shape(2) == columns;
  };
  require(has_shape(poses.position, 2) && has_shape(poses.orientation, 1) &&
              poses.edges.shape(0) == 2 && poses.edges.shape(1) == 2,
          "position, orientation and edges have no shapes (2, N, 2), (2, N, 1) and (2, 2).");
  require_finite(poses.position, "position");
  require_finite(poses.orientation, "orientation");
  require_finite(poses.edges, "edges");
  require_edges(poses.edges.data(), 2);
}

template <class Model>
void take(Vicinity<Model> &of, const Array2<std::int64_t> &pairs, const Array2<std::int64_t> &shift,
          const PoseArrays &then, const Vec<3> &hold)
{
  check_poses(then, of.n_particles());
  require(of.has_base(), "there is no base yet, expected move_to before.");
  require_pairs(pairs, shift, 2, of.n_particles());
  require_finite(hold.c, 3, "wide, reach and skin");
  of.take({{pairs.data(), pairs.data() + pairs.size()},
           {shift.data(), shift.data() + shift.size()},
           then.sum(),
           hold[0],
           hold[1]},
          hold[2]);
}

template <class Model>
Displacement checked(const Vicinity<Model> &of, const Array1<double> &x, double strain)
{
  require(x.shape(0) == of.n(), "x has " + std::to_string(x.shape(0)) +
                                    " components, expected one for each of " +
                                    std::to_string(of.n()) + " coordinates.");
  require(of.has_base(), "there is no base yet, expected move_to before.");
  require_finite(x, "x");
  require_finite(strain, "strain");
  return {x.data(), strain};
}

nb::object array_of(const double *from, std::size_t n)
{
  NewArray<double> to({n});
  std::copy_n(from, n, to.row(0));
  return to.release();
}

nb::object tuple_of(const LandscapeSums &sums)
{
  return nb::make_tuple(sums.energy, array_of(sums.gradient.data(), sums.gradient.size()),
                        sums.strain_gradient, sums.bond_force, sums.n_bonds, sums.crossing,
                        sums.unconverged);
}

template <class Model>
nb::object evaluate(Vicinity<Model> &of, const Array1<double> &x, double strain, bool extended)
{
  const Displacement at = checked(of, x, strain);
  return of.holds(at) ? tuple_of(of.evaluate(at, extended)) : nb::none();
}

template <class Model>
Factors factorise(Vicinity<Model> &of, const Array1<double> &x, double strain,
                  const Array1<double> &diagonal)
{
  require(diagonal.shape(0) == of.n(), "diagonal has another length than there are coordinates.");
  require(of.has_pairs(), "there are no pairs yet, expected take_pairs before.");
  const Factors found = of.factorise(checked(of, x, strain), diagonal.data());
  require(found != nullptr, "the Hessian holds what is not a number.");
  return found;
}

Eigen::Map<const Eigen::VectorXd> vector(const Array1<double> &of)
{
  return {of.data(), static_cast<Eigen::Index>(of.shape(0))};
}

template <class Model>
void move_to(Vicinity<Model> &of, const Array3<double> &position, const Array3<double> &orientation,
             const Array2<double> &edges)
{
  const PoseArrays poses{position, orientation, edges};
  check_poses(poses, of.n_particles());
  of.move_to(poses.sum());
}

/// Fills the doubles and their small rests of an array (2, ...).
void split_into(NewArray<double> &to, const long double *from, std::size_t size)
{
  for (std::size_t k = 0; k < size; ++k) {
    to[k] = static_cast<double>(from[k]);
    to[size + k] = static_cast<double>(from[k] - to[k]);
  }
}

nb::object tuple_of(const Poses &poses)
{
  const std::size_t N = poses.angle.size();
  NewArray<double> position({2, N, 2}), orientation({2, N, 1}), edges({2, 2});
  split_into(position, poses.position.data(), 2 * N);
  split_into(orientation, poses.angle.data(), N);
  split_into(edges, &poses.edges[0], 2);
  return nb::make_tuple(position.release(), orientation.release(), edges.release());
}

template <class Model> nb::object move(Vicinity<Model> &of, const Array1<double> &x, double strain)
{
  of.move(checked(of, x, strain));
  return tuple_of(of.poses());
}

/// A stage with its scales, and the guesses that it starts from.
struct PosedStage {
  Stage equation;
  StageUnits units;
  StageLimits limits;
  Eigen::VectorXd guess, other;
};

template <class Model>
StageEnd solve_stage(Vicinity<Model> &of, const PosedStage &stage, const Factors &factors,
                     const nb::callable &renew)
{
  for (const auto *part :
       {&stage.equation.drag, &stage.equation.centre, &stage.guess, &stage.other}) {
    require(static_cast<std::size_t>(part->size()) == of.n(),
            "a part of a stage has another length than there are coordinates.");
    require_finite(*part, "a part of a stage");
  }
  require_finite(stage.equation.strain, "strain");
  require(of.has_base(), "there is no base yet, expected move_to before.");
  require(!factors || factors->size() == of.n(),
          "the factors are of another number of coordinates.");
  const auto renewed = [&](const Displacement &at) { renew(array_of(at.x, of.n()), at.strain); };
  return StageSolver<Model>(of, stage.equation, stage.units, stage.limits, renewed)
      .solve(stage.guess, stage.other, factors);
}

double size_of(const StageUnits &units, const Array1<double> &shift, const Array1<double> &force,
               const Array1<double> &drag)
{
  require(shift.shape(0) == force.shape(0) && shift.shape(0) == drag.shape(0),
          "shift, force and drag have different lengths.");
  return units.size(vector(shift), vector(force), vector(drag));
}

void export_stages(nb::module_ &m)
{
  using namespace nb::literals;
  nb::class_<StageUnits>(m, "StageUnits", "What errors of displacements are measured in.")
      .def(nb::init<double, double, double, double>(), "force"_a, "energy"_a, "length"_a,
           "n_particles"_a)
      .def_ro("force", &StageUnits::force)
      .def_ro("energy", &StageUnits::energy)
      .def_ro("length", &StageUnits::length)
      .def("size", &size_of, "shift"_a, "force"_a, "drag"_a,
           "Of a displacement (n,), the force that makes it and the drag over the time.");
  nb::class_<StageLimits>(m, "StageLimits")
      .def(nb::init<double, double, double>(), "accuracy"_a, "longest_step"_a, "widest_turn"_a);
  nb::class_<PosedStage>(m, "Stage", "drag (x - centre) + dU/dx = 0 in a box of given strain.")
      .def(
          "__init__",
          [](PosedStage *place, double strain, const Array1<double> &drag,
             const Array1<double> &centre, bool extended, const StageUnits &units,
             const StageLimits &limits, const Array1<double> &guess, const Array1<double> &other) {
            new (place) PosedStage{{strain, vector(drag), vector(centre), extended},
                                   units,
                                   limits,
                                   vector(guess),
                                   vector(other)};
          },
          "strain"_a, "drag"_a, "centre"_a, "extended"_a, "units"_a, "limits"_a, "guess"_a,
          "other"_a);
  nb::class_<StageEnd>(m, "StageEnd")
      .def_prop_ro("x", [](const StageEnd &end) { return array_of(end.x.data(), end.x.size()); })
      .def_prop_ro("sums", [](const StageEnd &end) { return tuple_of(end.sums); })
      .def_ro("factors", &StageEnd::factors)
      .def_ro("evaluations", &StageEnd::evaluations)
      .def_ro("factorisations", &StageEnd::factorisations)
      .def_ro("directions", &StageEnd::directions)
      .def_ro("solved", &StageEnd::solved);
}

template <class AnyFactors> nb::object solve(const AnyFactors &factors, const Array2<double> &right)
{
  const std::size_t n = right.shape(1);
  require(n == factors.size(), "right has another length than the matrix.");
  NewArray<double> solution({right.shape(0), n});
  for (std::size_t k = 0; k < right.shape(0); ++k) {
    const Eigen::Map<const Eigen::VectorXd> side(right.data() + k * n, n);
    Eigen::Map<Eigen::VectorXd>(solution.row(k), n) = factors.solve(side);
  }
  return solution.release();
}

/// Whether these are starts of columns and rows of a square sparse matrix (CSC).
bool are_columns(const Array1<int> &start, const Array1<int> &row)
{
  if (start.shape(0) == 0) return false;
  const int *const first = start.data(), *const last = first + start.shape(0) - 1;
  const auto n = static_cast<int>(last - first);
  return *first == 0 && static_cast<std::size_t>(*last) == row.shape(0) &&
         std::is_sorted(first, last + 1) &&
         std::all_of(row.data(), row.data() + row.shape(0), [n](int r) { return r >= 0 && r < n; });
}

void make_factors(SymmetricFactors *place, const Array1<int> &start, const Array1<int> &row,
                  const Array1<double> &value)
{
  require(are_columns(start, row) && row.shape(0) == value.shape(0),
          "start, row and value are not the columns of a sparse matrix.");
  require_finite(value, "value");
  const int n = static_cast<int>(start.shape(0)) - 1;
  const UpperTriangle matrix = Eigen::Map<const UpperTriangle>(
      n, n, static_cast<Eigen::Index>(row.shape(0)), start.data(), row.data(), value.data());
  const Order order = sparse_order(matrix);
  UpperTriangle ordered(n, n);
  ordered.selfadjointView<Eigen::Upper>() = matrix.selfadjointView<Eigen::Upper>().twistedBy(order);
  new (place) SymmetricFactors(ordered, order);
  if (!place->factorise(ordered)) {
    place->~SymmetricFactors();
    throw std::runtime_error("The matrix is singular.");
  }
}

template <class Model> void export_vicinity_of(nb::module_ &m)
{
  using namespace nb::literals;
  const std::string name = class_name<Model>() + "Vicinity";
  nb::class_<Vicinity<Model>>(m, name.c_str())
      .def("move_to", &move_to<Model>, "position"_a, "orientation"_a, "edges"_a,
           "Count coordinates from these poses, doubles and their small rests.")
      .def("move", &move<Model>, "x"_a, "strain"_a,
           "Count coordinates from a point near the base; gives its poses as move_to takes them.")
      .def(
          "evaluate", &evaluate<Model>, "x"_a, "strain"_a, "extended"_a,
          "None where the pairs no longer hold, or energy, gradient (n,), derivative by the\n"
          "strain, sum of the magnitudes of bond forces, number of bonds, and a pair that crosses\n"
          "and one that is unconverged, or -1.")
      .def(
          "stretch",
          [](const Vicinity<Model> &of, double strain) {
            return array_of(of.stretch(strain).data(), of.n());
          },
          "strain"_a, "(n,) 1 + strain for displacements, 1 for rotations.")
      .def("factorise", &factorise<Model>, "x"_a, "strain"_a, "diagonal"_a,
           "BlockFactors of the Hessian by these coordinates plus a diagonal (n,), shifted if\n"
           "it is not positive definite.")
      .def(
          "take_pairs",
          [](Vicinity<Model> &of, const Array3<double> &position, const Array3<double> &orientation,
             const Array2<double> &edges, const Array2<std::int64_t> &pairs,
             const Array2<std::int64_t> &shift, double wide, double reach, double skin) {
            take(of, pairs, shift, {position, orientation, edges}, {{wide, reach, skin}});
          },
          "position"_a, "orientation"_a, "edges"_a, "pairs"_a, "shift"_a, "wide"_a, "reach"_a,
          "skin"_a,
          "All pairs of surfaces that are closer than a wide skin at these poses, and centres "
          "than\n"
          "reach; from them those within skin are chosen anew as particles move.")
      .def("solve_stage", &solve_stage<Model>, "stage"_a, "factors"_a.none(), "renew"_a,
           "The StageEnd of a Stage, with factors of an earlier one; renew(x, strain) takes pairs\n"
           "that hold there.");
}

}  // namespace

void export_vicinity(nb::module_ &m)
{
  using namespace nb::literals;
  nb::class_<SymmetricFactors>(m, "SymmetricFactors")
      .def("__init__", &make_factors, "start"_a, "row"_a, "value"_a,
           "Of a matrix in CSC, of which the upper triangle is read. RuntimeError if singular.")
      .def_prop_ro("n_negative", &SymmetricFactors::n_negative)
      .def("solve", &solve<SymmetricFactors>, "right"_a, "For the rows of right (k, n).");
  nb::class_<BlockFactors>(m, "BlockFactors", "Of a positive definite matrix.")
      .def_prop_ro("n_negative", [](const BlockFactors &) { return 0; })
      .def("solve", &solve<BlockFactors>, "right"_a, "For the rows of right (k, n).");
  m.attr("LEAST_SHIFT") = LEAST_SHIFT;
  export_stages(m);

  Shapes::each([&](auto model) {
    using Model = decltype(model);
    export_vicinity_of<Model>(m);
    class_of<Model>().def(
        "vicinity",
        [](const ShapeOf<Model> &of, const Array2<std::int64_t> &column,
           const Array1<double> &rotation_length, const Array1<double> &turning_radius) {
          require(of.dimension() == 2, "the packing has three dimensions, expected two.");
          return Vicinity<Model>(
              of.shapes(), CoordinateArrays{column, rotation_length, turning_radius}.read(of.n()),
              of.law());
        },
        "column"_a, "rotation_length"_a, "turning_radius"_a,
        "The energy about a base, of particles in the plane; column (N, 3) numbers of the\n"
        "coordinates x, y, rotation, or -1. Before anything else, move_to a base; pairs are asked\n"
        "for by what evaluate gives.");
  });
}

}  // namespace jamshape
