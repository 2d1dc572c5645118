// Contact geometry of single pairs, row by row, called only by tests and measurements of errors.

#include "contact/clump/form.hpp"
#include "contact/extended.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"
#include "contact/spheropolygon/form.hpp"
#include "contact/superellipsoid/superellipsoid.hpp"

#include "bindings/arrays.hpp"
#include "bindings/contact_arrays.hpp"
#include "bindings/shape.hpp"
#include "landscape/elimination_order.hpp"
#include "packing/team.hpp"

#include <nanobind/stl/optional.h>
#include <optional>
#include <stdexcept>
#include <string>

namespace jamshape {

namespace {

using Bodies = Array2<double>;

void require_body(bool condition, std::size_t n, const char *otherwise)
{
  if (!condition) throw std::invalid_argument("body " + std::to_string(n) + " " + otherwise);
}

/// Rows of spherocylinders: shape and pose unchanged, even if no quaternion gives exactly this
/// axis.
struct SpherocylinderRows {
  using Model = SpherocylinderModel;
  static constexpr std::size_t COLUMNS_2D = 6, COLUMNS_3D = 8, MOST_COLUMNS = 8;
  static constexpr const char *RULE = "6 (2D) or 8 (3D): centre, axis, half_length, radius.";

  template <int D>
  static SpherocylinderBody<D> read(const double *row, std::size_t n, std::size_t /*columns*/)
  {
    const double half_length = row[2 * D], radius = row[2 * D + 1];
    require_body(half_length >= 0.0 && std::isfinite(half_length) && radius > 0.0 &&
                     std::isfinite(radius),
                 n, "is not a valid shape: a rod has a half length of at least 0 and a radius.");
    require_body(are_finite(row, 2 * D), n,
                 "is without a finite pose: its centre or axis is not finite.");
    return {read_vec<D>(row), read_vec<D>(row + D), row[2 * D], row[2 * D + 1]};
  }
};

struct SuperellipsoidRows {
  using Model = SuperellipsoidModel;
  static constexpr std::size_t COLUMNS_2D = 6, COLUMNS_3D = 11, MOST_COLUMNS = 12;
  static constexpr const char *RULE =
      "6 (2D: centre, angle, semi-axes, p) or 11 (3D: centre, quaternion, semi-axes, p) or 12 (n1, "
      "n2 in place of p).";

  /// The two bodies of a pair in extended precision.
  template <int D>
  static PosedPair<Model, D, long double> in_long(const double *row_i, const double *row_j,
                                                  std::size_t columns, const Model::Law &law)
  {
    Vec<D, long double> r;
    for (int k = 0; k < D; ++k) r[k] = static_cast<long double>(row_i[k]) - row_j[k];
    return {*shape<D>(row_i, columns),
            *shape<D>(row_j, columns),
            r,
            orientation<D, long double>(row_i + D),
            orientation<D, long double>(row_j + D),
            law};
  }

  template <int D>
  static SuperellipsoidBody<D> read(const double *row, std::size_t n, std::size_t columns)
  {
    const double *turn = row + D;
    const auto shape = SuperellipsoidRows::shape<D>(row, columns);
    require_body(
        shape.has_value(), n,
        "is not a valid shape: a superellipsoid has positive semi-axes and an exponent p above "
        "0.5, or n1 and n2 above 1.");
    require_body(are_finite(row, D) && is_turn<D>(turn), n,
                 "is without a finite pose: its centre or orientation is not finite, or the "
                 "quaternion zero.");
    auto body = Model::body<D>(*shape);
    body.centre = read_vec<D>(row);
    Model::turn_to<D>(body, orientation<D>(turn));
    return body;
  }

 private:
  template <int D>
  static std::optional<Superellipsoid> shape(const double *row, std::size_t columns)
  {
    const double *axes = row + D + (D == 2 ? 1 : 4);
    const auto form = Model::Form::from({axes + D, row + columns}, D);
    if (!form) return std::nullopt;
    return Model::shape_from({{axes[0], axes[1], D == 2 ? axes[1] : axes[D - 1]}}, *form);
  }

  template <int D, class S = double> static QuaternionOf<S> orientation(const double *turn)
  {
    const S half = S(0.5) * turn[0];
    if (D == 2) return {std::cos(half), 0.0, 0.0, std::sin(half)};
    return normalized(QuaternionOf<S>{turn[0], turn[1], turn[2], turn[3]});
  }
};

/// M pairs of bodies, or of a body then and now.
template <class Rows> class BodyPairs {
 public:
  BodyPairs(const Bodies &bodies_i, const Bodies &bodies_j) : i(bodies_i), j(bodies_j)
  {
    require(i.shape(0) == j.shape(0) && i.shape(1) == j.shape(1),
            "bodies_i and bodies_j differ in shape, expected one row each a pair.");
    const std::size_t columns = i.shape(1);
    require(columns == Rows::COLUMNS_2D ||
                (columns >= Rows::COLUMNS_3D && columns <= Rows::MOST_COLUMNS),
            "bodies have " + std::to_string(columns) + " columns, expected " + Rows::RULE);
  }

  const double *row_i(std::size_t n) const { return i.data() + n * i.shape(1); }
  const double *row_j(std::size_t n) const { return j.data() + n * j.shape(1); }
  int dimension() const { return i.shape(1) == Rows::COLUMNS_2D ? 2 : 3; }
  std::size_t size() const { return i.shape(0); }
  std::size_t columns() const { return i.shape(1); }
  template <int D> auto first(std::size_t n) const { return at<D>(i, n); }
  template <int D> auto second(std::size_t n) const { return at<D>(j, n); }

 private:
  const Bodies &i, &j;

  template <int D> static auto at(const Bodies &bodies, std::size_t n)
  {
    return Rows::template read<D>(bodies.data() + n * bodies.shape(1), n, bodies.shape(1));
  }
};

/// (M,) results of `ask(i, j)` for each pair.
template <class T, class Rows, class Ask>
nb::object each(const BodyPairs<Rows> &pairs, const Ask &ask)
{
  NewArray<T> answer({pairs.size()});
  in_dimension(pairs.dimension(), [&](auto D) {
    for (std::size_t n = 0; n < pairs.size(); ++n) {
      answer[n] = ask(pairs.template first<D>(n), pairs.template second<D>(n));
    }
  });
  return answer.release();
}

template <class Rows>
nb::dict contacts(const BodyPairs<Rows> &pairs, const typename Rows::Model::Law &law)
{
  nb::dict result;
  in_dimension(pairs.dimension(), [&](auto D) {
    ContactArrays<typename Rows::Model, D> found(pairs.size());
    for (std::size_t n = 0; n < pairs.size(); ++n) {
      const auto i = pairs.template first<D>(n), j = pairs.template second<D>(n);
      found.set(n, contact_of(i, j, law), i, j);
    }
    found.release_to(result);
  });
  return result;
}

nb::dict spherocylinder_contacts(const Bodies &bodies_i, const Bodies &bodies_j, double k_e,
                                 int sides, double power)
{
  return contacts(BodyPairs<SpherocylinderRows>(bodies_i, bodies_j),
                  law_of<SpherocylinderModel>(k_e, {sides, power}));
}

nb::object spine_distances(const Bodies &bodies_i, const Bodies &bodies_j)
{
  return each<double>(
      BodyPairs<SpherocylinderRows>(bodies_i, bodies_j),
      [](const auto &i, const auto &j) { return std::sqrt(spine_distance_sq(spine_pair(i, j))); });
}

template <int D>
nb::dict superellipsoid_contacts_in(const BodyPairs<SuperellipsoidRows> &pairs,
                                    const SuperellipsoidLaw &law, bool extended, bool with_errors)
{
  using Model = SuperellipsoidModel;
  ContactArrays<Model, D> found(pairs.size());
  ErrorArrays errors(pairs.size(), with_errors);
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    const auto i = pairs.first<D>(n), j = pairs.second<D>(n);
    const auto longer = [&] {
      return SuperellipsoidRows::in_long<D>(pairs.row_i(n), pairs.row_j(n), pairs.columns(), law);
    };
    const auto contact = extended ? rounded(contact_at<Model, D, long double>(longer()))
                                  : to_its_digits<Model, D>(contact_of(i, j, law), longer);
    found.set(n, contact, i, j);
    errors.set(n, [&] { return errors_at<Model, D>(contact, longer()); });
  }
  nb::dict result;
  found.release_to(result);
  errors.release_to(result);
  return result;
}

nb::dict superellipsoid_contacts(const Bodies &bodies_i, const Bodies &bodies_j, double epsilon,
                                 bool extended, bool errors)
{
  const BodyPairs<SuperellipsoidRows> pairs(bodies_i, bodies_j);
  const auto law = law_of<SuperellipsoidModel>(epsilon, {1});
  return in_dimension(pairs.dimension(), [&](auto D) {
    return superellipsoid_contacts_in<D>(pairs, law, extended, errors);
  });
}

/// The tangency of pair n in long doubles.
template <int D>
FoundTangency<D, double> tangency_in_long(const BodyPairs<SuperellipsoidRows> &pairs, std::size_t n)
{
  using Long = long double;
  const auto pair = SuperellipsoidRows::in_long<D>(pairs.row_i(n), pairs.row_j(n), pairs.columns(),
                                                   law_of<SuperellipsoidModel>(1.0, {1}));
  const PosedBodies<SuperellipsoidModel, D, Long> bodies(pair);
  const auto longer =
      tangency_of(bodies.i, bodies.j, TangencyWish<D, Long>{pair.r, false, nullptr});
  return {plain<double>(longer.at),
          static_cast<double>(longer.gap),
          longer.iterations,
          longer.is_fallback,
          false,
          longer.is_settled};
}

template <int D>
nb::dict scales(const BodyPairs<SuperellipsoidRows> &pairs,
                const std::optional<Array2<double>> &normals)
{
  NewArray<double> eta({pairs.size()}), gap({pairs.size()});
  NewArray<double> normal({pairs.size(), D}), point_i({pairs.size(), D});
  NewArray<int> iterations({pairs.size()});
  NewArray<bool> fallback({pairs.size()}), extended({pairs.size()});
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    const auto i = pairs.first<D>(n), j = pairs.second<D>(n);
    TangencyWish<D, double> wish{i.centre - j.centre, false, nullptr};
    require(norm_sq(wish.r) > 0.0,
            "the bodies of pair " + std::to_string(n) + " have the same centre.");
    Vec<D> last;
    if (normals.has_value()) {
      last = read_vec<D>(normals->data() + D * n);
      wish.last = &last;
    }
    FoundTangency<D, double> found = tangency_of(i, j, wish);
    extended[n] = !found.is_settled;
    if (extended[n]) found = tangency_in_long<D>(pairs, n);
    eta[n] = found.at.scale;
    gap[n] = found.gap;
    iterations[n] = found.iterations;
    fallback[n] = found.is_fallback;
    write_vec((1.0 / norm(found.at.normal)) * found.at.normal, normal.row(n));
    write_vec(-found.at.point_i, point_i.row(n));
  }
  nb::dict result;
  result["eta"] = eta.release();
  result["gap"] = gap.release();
  result["iterations"] = iterations.release();
  result["fallback"] = fallback.release();
  result["extended"] = extended.release();
  result["normal"] = normal.release();
  result["point_i"] = point_i.release();
  return result;
}

nb::dict superellipsoid_scales(const Bodies &bodies_i, const Bodies &bodies_j,
                               const std::optional<Array2<double>> &normals)
{
  const BodyPairs<SuperellipsoidRows> pairs(bodies_i, bodies_j);
  require(!normals.has_value() ||
              (normals->shape(0) == pairs.size() &&
               normals->shape(1) == static_cast<std::size_t>(pairs.dimension())),
          "normals do not have the shape (M, D).");
  if (normals.has_value()) require_finite(*normals, "normals");
  return in_dimension(pairs.dimension(), [&](auto D) { return scales<D>(pairs, normals); });
}

nb::object superellipsoid_near(const Bodies &bodies_i, const Bodies &bodies_j, double margin)
{
  return each<bool>(
      BodyPairs<SuperellipsoidRows>(bodies_i, bodies_j),
      [&](const auto &i, const auto &j) { return SuperellipsoidModel::closer_than(margin, i, j); });
}

nb::object superellipsoid_motion_sq(const Bodies &then, const Bodies &now)
{
  return each<double>(BodyPairs<SuperellipsoidRows>(then, now),
                      [](const auto &before, const auto &body) {
                        return SuperellipsoidModel::motion_sq(body.centre - before.centre, body,
                                                              SuperellipsoidModel::pose(before));
                      });
}

nb::object superellipsoid_overlap(const Bodies &bodies_i, const Bodies &bodies_j)
{
  return each<bool>(BodyPairs<SuperellipsoidRows>(bodies_i, bodies_j),
                    [](const auto &i, const auto &j) { return are_overlapping(i, j); });
}

/// Lets a team count its parts repeatedly; in each round but the last, some of them fail.
nb::object counts_of_team(std::int64_t asked, std::size_t first_that_fails, int rounds)
{
  require_threads(asked);
  const auto threads = static_cast<std::size_t>(asked);
  Team team(threads);
  NewArray<std::int64_t> counts({threads});
  std::fill_n(&counts[0], threads, 0);
  const auto part = [&](std::size_t k, std::size_t fails) {
    ++counts[k];
    if (k >= fails) throw std::runtime_error("part " + std::to_string(k) + " failed");
  };
  std::string failed;
  for (int round = 0; round < rounds; ++round) {
    const std::size_t fails = round + 1 < rounds ? first_that_fails : threads;
    try {
      team.run([&](std::size_t k) { part(k, fails); });
    } catch (const std::runtime_error &error) {
      failed = error.what();
    }
  }
  return nb::make_tuple(counts.release(), failed.c_str());
}

std::vector<Ball> discs_in(const Array2<double> &rows, int dimension)
{
  require(rows.shape(1) == 4, "discs do not have the shape (n, 4), x y z r of each.");
  require(dimension == 2 || dimension == 3,
          "dimension is " + std::to_string(dimension) + ", expected 2 or 3.");
  const auto discs = read_discs({rows.data(), rows.data() + rows.size()}, dimension);
  require(discs.has_value(), "discs hold a row that is not a disc, expected x y z r of 1 to " +
                                 std::to_string(MOST_DISCS) +
                                 " of them with positive radii, in 2D with z = 0.");
  return *discs;
}

nb::object as_array(const Moments &found)
{
  NewArray<double> values({10});
  values[0] = found.measure;
  for (int k = 0; k < 3; ++k) values[1 + k] = found.first[k];
  for (int k = 0; k < 6; ++k) values[4 + k] = found.second[k];
  return values.release();
}

nb::object union_moments(const Array2<double> &rows, int dimension)
{
  return as_array(moments_of(discs_in(rows, dimension), dimension));
}

nb::object polygon_moments(double rounding, const Array2<double> &corners)
{
  require(corners.shape(1) == 2, "corners do not have the shape (n, 2).");
  FormNumbers numbers{rounding};
  numbers.insert(numbers.end(), corners.data(), corners.data() + corners.size());
  const auto polygon = read_polygon(numbers);
  require(polygon.has_value(), "corners do not form a convex polygon, expected 1 to " +
                                   std::to_string(MOST_CORNERS) +
                                   " corners, counter-clockwise, and a positive rounding radius.");
  return as_array(polygon->moments());
}

nb::object boundary_arcs(const Array2<double> &rows)
{
  const std::vector<Ball> discs = discs_in(rows, 2);
  std::vector<double> found;
  for (std::size_t k = 0; k < discs.size(); ++k) {
    for (const auto &[from, to] : detail::free_arcs(discs, k)) {
      found.insert(found.end(), {static_cast<double>(k), from, to});
    }
  }
  NewArray<double> arcs({found.size() / 3, 3});
  for (std::size_t n = 0; n < found.size(); ++n) arcs[n] = found[n];
  return arcs.release();
}

nb::object order_of_elimination(const Array2<double> &position, const Array2<std::int64_t> &pairs)
{
  const std::size_t N = position.shape(0), D = position.shape(1);
  require((D == 2 || D == 3) && pairs.shape(1) == 2,
          "positions and pairs do not have the shapes (N, D) and (M, 2).");
  require(are_finite(position.data(), position.size()), "a position is not finite.");
  const std::vector<std::int64_t> of(pairs.data(), pairs.data() + pairs.size());
  require(std::all_of(of.begin(), of.end(),
                      [&](std::int64_t n) { return n >= 0 && static_cast<std::size_t>(n) < N; }),
          "a pair has a particle that does not exist.");
  const std::vector<double> at(position.data(), position.data() + position.size());
  const std::vector<int> place =
      D == 2 ? elimination_order<2>(at, of) : elimination_order<3>(at, of);
  NewArray<std::int64_t> places({N});
  for (std::size_t n = 0; n < N; ++n) places[n] = place[n];
  return places.release();
}

}  // namespace

void export_probes(nb::module_ &m)
{
  using namespace nb::literals;
  m.def("spherocylinder_contacts", &spherocylinder_contacts, "bodies_i"_a, "bodies_j"_a, "k_e"_a,
        "sides"_a, "power"_a = HARMONIC,
        "Contacts of M pairs. Bodies are (M, 6) in 2D, (M, 8) in 3D: centre, unit axis,\n"
        "half_length, radius. Returns the arrays of Spherocylinders.contacts, of all M pairs\n"
        "(status 0: apart).");
  m.def("spine_distances", &spine_distances, "bodies_i"_a, "bodies_j"_a,
        "Shortest distances (M,) of the spines of M pairs, 0 where they cross.");
  m.def("superellipsoid_contacts", &superellipsoid_contacts, "bodies_i"_a, "bodies_j"_a,
        "epsilon"_a, "extended"_a = false, "errors"_a = false,
        "Contacts of M pairs. Bodies are (M, 6) in 2D: centre, angle, two semi-axes, p; (M, 11)\n"
        "in 3D: centre, quaternion w i j k, three semi-axes, p, or (M, 12) with n1, n2 in place\n"
        "of p. Returns the arrays of\n"
        "Superellipsoids.contacts, of all M pairs (status 0: apart). Of a bond 1 -\n"
        "distance/reach is 1 - eta^2.");
  m.def("superellipsoid_scales", &superellipsoid_scales, "bodies_i"_a, "bodies_j"_a,
        "normals"_a.none() = nb::none(),
        "The scale at which both bodies of M pairs touch, whether above 1 or below, starting from\n"
        "`normals` (M, D) if given. Returns a dict: eta, gap (relative bound of its error),\n"
        "iterations, fallback (the first attempt failed), extended (in long doubles, as doubles "
        "were\n"
        "too short), normal (into i, unit), point_i (from the\n"
        "centre of i to the tangency of the scaled bodies).");
  m.def("superellipsoid_near", &superellipsoid_near, "bodies_i"_a, "bodies_j"_a, "margin"_a,
        "Whether surfaces may be closer than `margin` (M,): false only if they are not.");
  m.def("superellipsoid_motion_sq", &superellipsoid_motion_sq, "then"_a, "now"_a,
        "Upper bounds of the squared displacement of any point of a body (M,).");
  m.def("superellipsoid_overlap", &superellipsoid_overlap, "bodies_i"_a, "bodies_j"_a,
        "Whether bodies share more than a point (M,).");
  m.def("counts_of_team", &counts_of_team, "threads"_a, "first_that_fails"_a, "rounds"_a,
        "Rounds in which each thread did its part (threads,), if those from first_that_fails on "
        "fail\n"
        "in all rounds but the last, and the last exception.");
  m.def("union_moments", &union_moments, "discs"_a, "dimension"_a,
        "Integrals over a union of discs (n, 4), x y z r of each, balls in 3D: of 1, x, y, z, xx, "
        "yy,\n"
        "zz, xy, xz, yz (10,).");
  m.def("polygon_moments", &polygon_moments, "rounding"_a, "corners"_a,
        "The same of a rounded polygon with corners (n, 2), counter-clockwise.");
  m.def(
      "boundary_arcs", &boundary_arcs, "discs"_a,
      "Arcs of the boundary of a union of discs (n, 4) in the plane (M, 3): index of the disc and\n"
      "the angles at both ends, counter-clockwise.");
  m.def("elimination_order", &order_of_elimination, "position"_a, "pairs"_a,
        "Places (N,) of particles in an order of elimination with little fill-in, from their\n"
        "positions (N, D) and the pairs (M, 2) that share a block.");
}

}  // namespace jamshape
