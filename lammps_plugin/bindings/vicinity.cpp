#include "landscape/vicinity.hpp"

#include "contact/spherocylinder.hpp"
#include "contact/superellipsoid.hpp"

#include "bindings/arrays.hpp"
#include "bindings/laws.hpp"
#include "bindings/pairs.hpp"

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

/// What of a vicinity is not in the arrays of the packing.
struct Extent {
  const Array2<std::int64_t> &column;     // (N, 3)
  const Array1<double> &rotation_length;  // (N,)
  const Array1<double> &turning_radius;   // (N,)
  double skin, reach;
};

Coordinates coordinates_of(const Extent &extent)
{
  const std::int64_t *const first = extent.column.data(), *const last =
                                                              first + extent.column.size();
  const std::int64_t highest = first == last ? -1 : *std::max_element(first, last);
  std::vector<double> per_length;
  for (std::size_t i = 0; i < extent.rotation_length.shape(0); ++i) {
    const double length = extent.rotation_length.data()[i];
    per_length.push_back(length > 0.0 ? 1.0 / length : 0.0);
  }
  return {static_cast<std::size_t>(highest + 1), {first, last}, per_length};
}

template <class Model>
void make(Vicinity<Model> *place, const PackingArrays &arrays, const Extent &extent,
          const typename Model::Law &law)
{
  arrays.check();
  const std::size_t N = arrays.n();
  require(arrays.dimension() == 2, "the packing has three dimensions, expected two.");
  require(extent.column.shape(0) == N && extent.column.shape(1) == 3 &&
              extent.rotation_length.shape(0) == N && extent.turning_radius.shape(0) == N,
          "column, rotation_length and turning_radius have no shapes (N, 3), (N,) and (N,).");
  const std::int64_t *const pairs = arrays.pairs.data(), *const shift = arrays.shift.data();
  const double *const radius = extent.turning_radius.data();
  NearPairs near{{pairs, pairs + arrays.pairs.size()},
                 {shift, shift + arrays.shift.size()},
                 PoseArrays{arrays.position, arrays.orientation, arrays.edges}.sum(),
                 extent.skin,
                 extent.reach,
                 {radius, radius + N}};
  new (place) Vicinity<Model>(arrays.shapes<Model>(), coordinates_of(extent), std::move(near), law);
}

template <class Model>
Displacement checked(const Vicinity<Model> &of, const Array1<double> &x, double strain)
{
  require(x.shape(0) == of.n(), "x has " + std::to_string(x.shape(0)) +
                                    " components, expected one for each of " +
                                    std::to_string(of.n()) + " coordinates.");
  return {x.data(), strain};
}

template <class Model, class S> nb::object sums(const Vicinity<Model> &of, const Displacement &at)
{
  const PairSums<2, S> sums = of.template sums<S>(at);
  NewArray<double> gradient({of.n()});
  of.gradient(sums, gradient.row(0));
  return nb::make_tuple(static_cast<double>(sums.energy), gradient.release(),
                        static_cast<double>(-sums.virial[0] - sums.virial[3]),
                        static_cast<double>(sums.bond_force), sums.n_bonds,
                        pair_or_none<2, S>(sums.crossing), pair_or_none<2, S>(sums.unconverged));
}

template <class Model>
nb::object evaluate(const Vicinity<Model> &of, const Array1<double> &x, double strain,
                    bool extended)
{
  const Displacement at = checked(of, x, strain);
  if (of.is_beyond(at)) return nb::none();
  return extended ? sums<Model, long double>(of, at) : sums<Model, double>(of, at);
}

template <class Model>
void linearise(Vicinity<Model> &of, const Array1<double> &x, double strain,
               const Array1<double> &diagonal)
{
  require(diagonal.shape(0) == of.n(), "diagonal has another length than there are coordinates.");
  of.linearise(checked(of, x, strain), diagonal.data());
}

template <class Model>
void move_to(Vicinity<Model> &of, const Array3<double> &position, const Array3<double> &orientation,
             const Array2<double> &edges)
{
  const std::size_t N = of.n_particles();
  require(position.size() == 4 * N && orientation.size() == 2 * N && edges.size() == 4,
          "position, orientation and edges have no shapes (2, N, 2), (2, N, 1) and (2, 2).");
  of.move_to(PoseArrays{position, orientation, edges}.sum());
}

nb::object solve(const SymmetricFactors &factors, const Array2<double> &right)
{
  NewArray<double> solution({right.shape(0), right.shape(1)});
  factors.solve(right.data(), right.shape(0), solution.row(0));
  return solution.release();
}

void make_factors(SymmetricFactors *place, const Array1<int> &start, const Array1<int> &row,
                  const Array1<double> &value)
{
  const int n = static_cast<int>(start.shape(0)) - 1;
  require(n >= 0 && row.shape(0) == value.shape(0) &&
              static_cast<std::size_t>(start.data()[n]) == row.shape(0),
          "start, row and value are not the columns of a sparse matrix.");
  const LowerTriangle matrix = Eigen::Map<const LowerTriangle>(
      n, n, static_cast<Eigen::Index>(row.shape(0)), start.data(), row.data(), value.data());
  new (place) SymmetricFactors(matrix);
  if (!place->factorise(matrix)) {
    place->~SymmetricFactors();
    throw std::runtime_error("The matrix is singular.");
  }
}

template <class Model> auto export_methods(nb::class_<Vicinity<Model>> class_)
{
  using namespace nb::literals;
  class_
      .def("move_to", &move_to<Model>, "position"_a, "orientation"_a, "edges"_a,
           "Count coordinates from these poses, doubles and their small rests.")
      .def(
          "evaluate", &evaluate<Model>, "x"_a, "strain"_a, "extended"_a,
          "None where the pairs no longer hold, or energy, gradient (n,), derivative by the\n"
          "strain, sum of the magnitudes of bond forces, number of bonds, and a pair that crosses\n"
          "and one that is unconverged, or -1.")
      .def("linearise", &linearise<Model>, "x"_a, "strain"_a, "diagonal"_a,
           "Take the Hessian by these coordinates plus a diagonal (n,).")
      .def_prop_ro("largest_diagonal", &Vicinity<Model>::largest_diagonal, "Of that matrix.")
      .def("factorised", &Vicinity<Model>::factorised, "shift"_a,
           "SymmetricFactors of that matrix plus a shift; None if singular.");
}

}  // namespace

void export_vicinity(nb::module_ &m)
{
  using namespace nb::literals;
  nb::class_<SymmetricFactors>(m, "SymmetricFactors")
      .def("__init__", &make_factors, "start"_a, "row"_a, "value"_a,
           "Of a matrix in CSC, of which the lower triangle is read. RuntimeError if singular.")
      .def_prop_ro("n_negative", &SymmetricFactors::n_negative)
      .def("solve", &solve, "right"_a, "For the rows of right (k, n).");

  nb::class_<Vicinity<SpherocylinderModel>> rods(m, "SpherocylinderVicinity");
  rods.def(
      "__init__",
      [](Vicinity<SpherocylinderModel> *place, const Array2<double> &diameters,
         const Array3<double> &position, const Array3<double> &orientation,
         const Array2<double> &edges, const Array2<std::int64_t> &pairs,
         const Array2<std::int64_t> &shift, double k_e, int sides,
         const Array2<std::int64_t> &column, const Array1<double> &rotation_length,
         const Array1<double> &turning_radius, double skin, double reach) {
        make<SpherocylinderModel>(place, {diameters, position, orientation, edges, pairs, shift},
                                  {column, rotation_length, turning_radius, skin, reach},
                                  spherocylinder_law(k_e, sides));
      },
      "diameters"_a, "position"_a, "orientation"_a, "edges"_a, "pairs"_a, "shift"_a, "k_e"_a,
      "sides"_a, "column"_a, "rotation_length"_a, "turning_radius"_a, "skin"_a, "reach"_a,
      "Arguments to sides as in spherocylinder_sums, in the plane; column (N, 3) numbers of the\n"
      "coordinates x, y, rotation, or -1; the pairs hold until surfaces may have come closer by "
      "skin.");
  export_methods(rods);

  nb::class_<Vicinity<SuperellipsoidModel>> ellipses(m, "SuperellipsoidVicinity");
  ellipses.def(
      "__init__",
      [](Vicinity<SuperellipsoidModel> *place, const Array2<double> &diameters,
         const Array1<double> &exponent, const Array3<double> &position,
         const Array3<double> &orientation, const Array2<double> &edges,
         const Array2<std::int64_t> &pairs, const Array2<std::int64_t> &shift, double epsilon,
         const Array2<std::int64_t> &column, const Array1<double> &rotation_length,
         const Array1<double> &turning_radius, double skin, double reach) {
        make<SuperellipsoidModel>(
            place, {diameters, position, orientation, edges, pairs, shift, &exponent},
            {column, rotation_length, turning_radius, skin, reach}, superellipsoid_law(epsilon));
      },
      "diameters"_a, "exponent"_a, "position"_a, "orientation"_a, "edges"_a, "pairs"_a, "shift"_a,
      "epsilon"_a, "column"_a, "rotation_length"_a, "turning_radius"_a, "skin"_a, "reach"_a,
      "As SpherocylinderVicinity.");
  export_methods(ellipses);
}

}  // namespace jamshape
