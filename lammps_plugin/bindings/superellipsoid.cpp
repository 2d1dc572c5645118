#include "contact/superellipsoid/superellipsoid.hpp"

#include "bindings/arrays.hpp"
#include "bindings/laws.hpp"
#include "bindings/pairs.hpp"

#include <nanobind/stl/optional.h>
#include <optional>

namespace jamshape {

namespace {

using Bodies = Array2<double>;

constexpr std::size_t COLUMNS_2D = 6, COLUMNS_3D = 11;

template <int D> SuperellipsoidBody<D> body_at(const Bodies &bodies, std::size_t n)
{
  const double *row = bodies.data() + n * bodies.shape(1);
  const double *turn = row + D, *axes = turn + (D == 2 ? 1 : 4);
  const Vec<3> semi_axes{{axes[0], axes[1], D == 2 ? axes[1] : axes[D - 1]}};
  const auto shape = SuperellipsoidModel::shape_from(semi_axes, axes[D]);
  require(shape.has_value(), "body " + std::to_string(n) +
                                 " is no such shape: a superellipsoid has positive semi-axes and "
                                 "an exponent p above 0.5.");
  auto body = SuperellipsoidModel::body<D>(*shape);
  body.centre = read_vec<D>(row);
  if constexpr (D == 2) {
    const double half = 0.5 * turn[0];
    SuperellipsoidModel::turn_to<D>(body, Quaternion{std::cos(half), 0.0, 0.0, std::sin(half)});
  } else {
    const Quaternion q{turn[0], turn[1], turn[2], turn[3]};
    SuperellipsoidModel::turn_to<D>(body, normalized(q));
  }
  return body;
}

int dimension_of(const Bodies &bodies)
{
  const std::size_t columns = bodies.shape(1);
  require(columns == COLUMNS_2D || columns == COLUMNS_3D,
          "bodies have " + std::to_string(columns) +
              " columns, expected 6 (2D: centre, angle, semi-axes, p) or 11 (3D: centre, "
              "quaternion, semi-axes, p).");
  return columns == COLUMNS_2D ? 2 : 3;
}

int dimension_of(const Bodies &i, const Bodies &j)
{
  require(i.shape(0) == j.shape(0) && i.shape(1) == j.shape(1),
          "bodies_i and bodies_j differ in shape, expected one row each a pair.");
  return dimension_of(i);
}

template <int D>
nb::dict contacts(const Bodies &bodies_i, const Bodies &bodies_j, const SuperellipsoidLaw &law)
{
  const std::size_t n_pairs = bodies_i.shape(0), torques = ROTATIONS<D>;
  NewArray<int> status({n_pairs});
  NewArray<double> error({n_pairs}), energy({n_pairs}), force({n_pairs, D});
  NewArray<double> torque_i({n_pairs, torques}), torque_j({n_pairs, torques});
  NewArray<double> bond_normal({n_pairs, D}), bond_arm_i({n_pairs, D});
  NewArray<double> bond_distance({n_pairs}), bond_reach({n_pairs}), bond_stiffness({n_pairs});
  for (std::size_t n = 0; n < n_pairs; ++n) {
    const Contact<D> contact = contact_of(body_at<D>(bodies_i, n), body_at<D>(bodies_j, n), law);
    status[n] = static_cast<int>(contact.status);
    error[n] = contact.error;
    energy[n] = contact.energy;
    write_vec(contact.force, force.row(n));
    write_vec(contact.torque_i, torque_i.row(n));
    write_vec(contact.torque_j, torque_j.row(n));
    if (contact.n_bonds == 0) continue;
    const Bond<D> &bond = contact.bond[0];
    write_vec(bond.normal, bond_normal.row(n));
    write_vec(bond.arm_i, bond_arm_i.row(n));
    bond_distance[n] = bond.distance;
    bond_reach[n] = bond.reach;
    bond_stiffness[n] = bond.stiffness;
  }
  nb::dict result;
  result["status"] = status.release();
  result["error"] = error.release();
  result["energy"] = energy.release();
  result["force"] = force.release();
  result["torque_i"] = torque_i.release();
  result["torque_j"] = torque_j.release();
  result["bond_normal"] = bond_normal.release();
  result["bond_arm_i"] = bond_arm_i.release();
  result["bond_distance"] = bond_distance.release();
  result["bond_reach"] = bond_reach.release();
  result["bond_stiffness"] = bond_stiffness.release();
  return result;
}

nb::dict superellipsoid_contacts(const Bodies &bodies_i, const Bodies &bodies_j, double epsilon)
{
  const SuperellipsoidLaw law = superellipsoid_law(epsilon);
  return dimension_of(bodies_i, bodies_j) == 2 ? contacts<2>(bodies_i, bodies_j, law)
                                               : contacts<3>(bodies_i, bodies_j, law);
}

template <int D>
nb::dict scales(const Bodies &bodies_i, const Bodies &bodies_j,
                const std::optional<Array2<double>> &normals)
{
  const std::size_t n_pairs = bodies_i.shape(0);
  NewArray<double> eta({n_pairs}), gap({n_pairs});
  NewArray<double> normal({n_pairs, D}), point_i({n_pairs, D});
  NewArray<int> iterations({n_pairs});
  NewArray<bool> fallback({n_pairs});
  for (std::size_t n = 0; n < n_pairs; ++n) {
    const auto i = body_at<D>(bodies_i, n), j = body_at<D>(bodies_j, n);
    TangencyWish<D, double> wish{i.centre - j.centre, false, nullptr};
    require(norm_sq(wish.r) > 0.0,
            "the bodies of pair " + std::to_string(n) + " have the same centre.");
    Vec<D> last;
    if (normals.has_value()) {
      last = read_vec<D>(normals->data() + D * n);
      wish.last = &last;
    }
    const FoundTangency<D, double> found = tangency_of(i, j, wish);
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
  result["normal"] = normal.release();
  result["point_i"] = point_i.release();
  return result;
}

nb::dict superellipsoid_scales(const Bodies &bodies_i, const Bodies &bodies_j,
                               const std::optional<Array2<double>> &normals)
{
  const int dimension = dimension_of(bodies_i, bodies_j);
  require(!normals.has_value() || (normals->shape(0) == bodies_i.shape(0) &&
                                   normals->shape(1) == static_cast<std::size_t>(dimension)),
          "normals have no shape (M, D).");
  return dimension == 2 ? scales<2>(bodies_i, bodies_j, normals)
                        : scales<3>(bodies_i, bodies_j, normals);
}

template <int D, class Predicate>
nb::object asked(const Bodies &bodies_i, const Bodies &bodies_j, const Predicate &predicate)
{
  NewArray<bool> answer({bodies_i.shape(0)});
  for (std::size_t n = 0; n < bodies_i.shape(0); ++n) {
    answer[n] = predicate(body_at<D>(bodies_i, n), body_at<D>(bodies_j, n));
  }
  return answer.release();
}

nb::object superellipsoid_near(const Bodies &bodies_i, const Bodies &bodies_j, double margin)
{
  const auto near = [&](const auto &i, const auto &j) {
    return SuperellipsoidModel::closer_than(margin, i, j);
  };
  return dimension_of(bodies_i, bodies_j) == 2 ? asked<2>(bodies_i, bodies_j, near)
                                               : asked<3>(bodies_i, bodies_j, near);
}

template <int D> nb::object motions_sq(const Bodies &then, const Bodies &now)
{
  NewArray<double> bound({now.shape(0)});
  for (std::size_t n = 0; n < now.shape(0); ++n) {
    const auto before = body_at<D>(then, n), body = body_at<D>(now, n);
    bound[n] = SuperellipsoidModel::motion_sq<D>(body.centre - before.centre, body,
                                                 SuperellipsoidModel::pose<D>(before));
  }
  return bound.release();
}

nb::object superellipsoid_motion_sq(const Bodies &then, const Bodies &now)
{
  return dimension_of(then, now) == 2 ? motions_sq<2>(then, now) : motions_sq<3>(then, now);
}

nb::object superellipsoid_overlap(const Bodies &bodies_i, const Bodies &bodies_j)
{
  const auto overlap = [](const auto &i, const auto &j) { return are_overlapping(i, j); };
  return dimension_of(bodies_i, bodies_j) == 2 ? asked<2>(bodies_i, bodies_j, overlap)
                                               : asked<3>(bodies_i, bodies_j, overlap);
}

nb::dict superellipsoid_sums(const Array2<double> &diameters, const Array1<double> &exponent,
                             const Array3<double> &position, const Array3<double> &orientation,
                             const Array2<double> &edges, const Array2<std::int64_t> &pairs,
                             const Array2<std::int64_t> &shift, double epsilon, bool extended)
{
  return pair_sums<SuperellipsoidModel>(
      {diameters, position, orientation, edges, pairs, shift, &exponent},
      superellipsoid_law(epsilon), extended);
}

nb::dict superellipsoid_derivatives(const Array2<double> &diameters, const Array1<double> &exponent,
                                    const Array3<double> &position,
                                    const Array3<double> &orientation, const Array2<double> &edges,
                                    const Array2<std::int64_t> &pairs,
                                    const Array2<std::int64_t> &shift, double epsilon,
                                    bool extended)
{
  return pair_derivatives<SuperellipsoidModel>(
      {diameters, position, orientation, edges, pairs, shift, &exponent},
      superellipsoid_law(epsilon), extended);
}

nb::object superellipsoid_bounding_radius(const Array2<double> &diameters,
                                          const Array1<double> &exponent, int dimension)
{
  const std::size_t n_particles = diameters.shape(0);
  require(diameters.shape(1) == 3 && exponent.shape(0) == n_particles,
          "diameters and exponent have no shapes (N, 3) and (N,).");
  NewArray<double> radius({n_particles});
  for (std::size_t n = 0; n < n_particles; ++n) {
    const Superellipsoid shape{0.5 * read_vec<3>(diameters.data() + 3 * n), exponent.data()[n]};
    radius[n] = dimension == 2 ? shape.bounding_radius<2>() : shape.bounding_radius<3>();
  }
  return radius.release();
}

nb::tuple superellipsoid_drag(const Array2<double> &diameters, const Array1<double> &exponent,
                              int dimension)
{
  const std::size_t n_particles = diameters.shape(0);
  require(diameters.shape(1) == 3, "diameters have no shape (N, 3).");
  require(exponent.shape(0) == n_particles, "diameters and exponent differ in length.");
  require(dimension == 2 || dimension == 3,
          "dimension is " + std::to_string(dimension) + ", expected 2 or 3.");
  NewArray<double> measure({n_particles}), moment({n_particles, 3});
  for (std::size_t n = 0; n < n_particles; ++n) {
    const auto shape = SuperellipsoidModel::shape_from(0.5 * read_vec<3>(diameters.data() + 3 * n),
                                                       exponent.data()[n]);
    require(shape.has_value(), "particle " + std::to_string(n) +
                                   " is no such shape: " + SuperellipsoidModel::SHAPE_RULE + ".");
    const SubstrateDrag drag = dimension == 2 ? SuperellipsoidModel::drag<2>(*shape)
                                              : SuperellipsoidModel::drag<3>(*shape);
    measure[n] = drag.measure;
    write_vec(drag.moment, moment.row(n));
  }
  return nb::make_tuple(measure.release(), moment.release());
}

}  // namespace

void export_superellipsoid(nb::module_ &m)
{
  using namespace nb::literals;
  m.def(
      "superellipsoid_contacts", &superellipsoid_contacts, "bodies_i"_a, "bodies_j"_a, "epsilon"_a,
      "Contacts of M pairs. Bodies are (M, 6) in 2D: centre, angle, two semi-axes, p; (M, 11) in\n"
      "3D: centre, quaternion w i j k, three semi-axes, p. Returns a dict of arrays: status (0\n"
      "apart, 1 touching, 2 concentric, 3 unconverged), error (relative, of the scale), energy,\n"
      "force (on i), torque_i, torque_j, bond_normal (into i), bond_arm_i, bond_distance,\n"
      "bond_reach (1 - distance/reach is 1 - eta^2), bond_stiffness.");
  m.def(
      "superellipsoid_scales", &superellipsoid_scales, "bodies_i"_a, "bodies_j"_a,
      "normals"_a.none() = nb::none(),
      "The scale at which both bodies of M pairs touch, whether above 1 or below, begun at\n"
      "`normals` (M, D) where given. Returns a dict: eta, gap (relative bound of its error),\n"
      "iterations, fallback (the first attempt failed), normal (into i, unit), point_i (from the\n"
      "centre of i to the tangency of the scaled bodies).");
  m.def("superellipsoid_near", &superellipsoid_near, "bodies_i"_a, "bodies_j"_a, "margin"_a,
        "Whether surfaces may be closer than `margin` (M,): false only where they are not.");
  m.def("superellipsoid_motion_sq", &superellipsoid_motion_sq, "then"_a, "now"_a,
        "Upper bound of the squared distance that any point of a body moved (M,).");
  m.def("superellipsoid_overlap", &superellipsoid_overlap, "bodies_i"_a, "bodies_j"_a,
        "Whether bodies share more than a point (M,).");
  m.def("superellipsoid_sums", &superellipsoid_sums, "diameters"_a, "exponent"_a, "position"_a,
        "orientation"_a, "edges"_a, "pairs"_a, "shift"_a, "epsilon"_a, "extended"_a,
        "As spherocylinder_sums, with an exponent p per particle (N,); the dict also has `error`, "
        "the\n"
        "largest relative error bar of a scale.");
  m.def("superellipsoid_derivatives", &superellipsoid_derivatives, "diameters"_a, "exponent"_a,
        "position"_a, "orientation"_a, "edges"_a, "pairs"_a, "shift"_a, "epsilon"_a, "extended"_a,
        "As spherocylinder_derivatives, with an exponent p per particle (N,).");
  m.def("superellipsoid_bounding_radius", &superellipsoid_bounding_radius, "diameters"_a,
        "exponent"_a, "dimension"_a, "Largest distance of the surface from the centre (N,).");
  m.def("superellipsoid_drag", &superellipsoid_drag, "diameters"_a, "exponent"_a, "dimension"_a,
        "Volume (area in 2D) (N,) and moments per body axis (N, 3), in units of length squared.");
}

}  // namespace jamshape
