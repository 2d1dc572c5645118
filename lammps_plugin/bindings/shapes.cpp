#include "contact/shapes.hpp"

#include "contact/extended.hpp"
#include "contact/host_spin.hpp"

#include "bindings/contact_arrays.hpp"
#include "bindings/shape.hpp"
#include "packing/near_particles.hpp"

#include <cmath>
#include <optional>
#include <type_traits>
#include <vector>

namespace jamshape {

namespace {

/// (N,) results of `value(D, shape)` for each particle.
template <class T, class Model, class Value>
nb::object each(const ShapeOf<Model> &of, const Value &value)
{
  NewArray<T> values({of.n()});
  of.in_space([&](auto D) {
    for (std::size_t i = 0; i < of.n(); ++i) values[i] = value(D, of.shapes()[i]);
  });
  return values.release();
}

std::int64_t axis_or_none(const std::optional<int> &axis) { return axis.value_or(-1); }

template <class Model> nb::object moments(const ShapeOf<Model> &of)
{
  NewArray<double> moment({of.n(), 3});
  of.in_space([&](auto D) {
    for (std::size_t i = 0; i < of.n(); ++i) {
      write_vec(Model::template drag<D>(of.shapes()[i]).moment, moment.row(i));
    }
  });
  return moment.release();
}

Quaternion orientation_from(std::integral_constant<int, 2>, const double *angle)
{
  return {std::cos(0.5 * *angle), 0.0, 0.0, std::sin(0.5 * *angle)};
}
Quaternion orientation_from(std::integral_constant<int, 3>, const double *q)
{
  return {q[0], q[1], q[2], q[3]};
}

template <class Model>
nb::object host_spins(const ShapeOf<Model> &of, const Array2<double> &orientation,
                      const Array2<double> &gradient)
{
  return of.in_space([&](auto D) {
    require(orientation.shape(0) == of.n() && orientation.shape(1) == (D == 2 ? 1 : 4) &&
                gradient.shape(0) == D && gradient.shape(1) == D,
            "orientation and gradient do not have shapes (N, 1 or 4) and (D, D).");
    const Upper g = upper_from<D>(gradient.data());
    NewArray<double> spin({of.n(), ROTATIONS<D>});
    for (std::size_t i = 0; i < of.n(); ++i) {
      const Vec<3> moment = Model::template drag<D>(of.shapes()[i]).moment;
      const Quaternion q = orientation_from(D, orientation.data() + orientation.shape(1) * i);
      write_vec(host_spin<D>(g, bretherton_parameters(moment), q), spin.row(i));
    }
    return spin.release();
  });
}

template <class Model> void export_sizes(nb::class_<ShapeOf<Model>> &of)
{
  using namespace nb::literals;
  using Self = const ShapeOf<Model> &;
  using Shape = const typename Model::Shape &;
  const auto length = [&](const char *name, const auto &value, const char *text) {
    of.def_prop_ro(name, [value](Self self) { return each<double>(self, value); }, text);
  };
  const auto axis = [&](const char *name, const auto &value, const char *text) {
    of.def_prop_ro(name, [value](Self self) { return each<std::int64_t>(self, value); }, text);
  };
  length(
      "measure", [](auto D, Shape s) { return Model::template drag<D>(s).measure; },
      "(N,) areas in 2D, volumes in 3D.");
  of.def_prop_ro("moment", &moments<Model>, "(N, 3) mean squared distances from the body's axes.");
  of.def(
      "host_spin", &host_spins<Model>, "orientation"_a, "gradient"_a,
      "Angular velocities (N, 1 or 3) of torque-free particles in a host with a\n"
      "constant upper triangular velocity gradient (D, D); angles (N, 1) or quaternions (N, 4).");
  length(
      "outer_radius", [](auto D, Shape s) { return Model::template outer_radius<D>(s); },
      "(N,) radii of the bounding spheres.");
  length(
      "inner_radius", [](auto D, Shape s) { return Model::template inner_radius<D>(s); },
      "(N,) smallest lengths of the particles.");
  length(
      "rotation_length", [](auto D, Shape s) { return Model::template rotation_length<D>(s); },
      "(N,) lengths that one radian stands for; 0 if no contact can rotate a particle.");
  length(
      "turning_radius", [](auto D, Shape s) { return Model::template turning_radius<D>(s); },
      "(N,) bounds of the motion of a surface towards others per radian.");
  axis(
      "symmetry_axis", [](auto, Shape s) { return axis_or_none(Model::symmetry_axis(s)); },
      "(N,) body axis (0, 1, 2) of rotational symmetry in space, or -1.");
  axis(
      "director", [](auto D, Shape s) { return axis_or_none(Model::template director<D>(s)); },
      "(N,) body axis (0, 1, 2) that gives the direction, or -1.");
}

/// (M,) results of `ask` for each pair.
template <class Model, class Ask>
nb::object each_pair(const ShapeOf<Model> &of, const PairArrays &arrays, const Ask &ask)
{
  NewArray<bool> answer({arrays.pairs.shape(0)});
  of.in_space([&](auto D) {
    const auto pairs = of.template posed<D, double>(arrays);
    for (std::size_t p = 0; p < pairs.size(); ++p) answer[p] = ask(pairs, p);
  });
  return answer.release();
}

/// A contact as a Python object.
template <int D, int BONDS>
const Contact<D, double, BONDS> &in_doubles(const Contact<D, double, BONDS> &contact)
{
  return contact;
}
template <int D, int BONDS>
Contact<D, double, BONDS> in_doubles(const Contact<D, long double, BONDS> &contact)
{
  return rounded(contact);
}

template <class Model, int D, class S>
[[gnu::noinline]] nb::dict contacts_in(const ShapeOf<Model> &of, const PairArrays &arrays,
                                       bool with_errors)
{
  const PosedPairs<Model, D, S> pairs = of.template posed<D, S>(arrays);
  std::vector<std::size_t> at;
  std::vector<ContactOf<Model, D, S>> found;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const ContactOf<Model, D, S> contact = contact_in(pairs, p, pairs.separation(p));
    if (contact.status == ContactStatus::APART) continue;
    at.push_back(p);
    found.push_back(contact);
  }
  NewArray<std::int64_t> pair({at.size()});
  NewArray<double> separation({at.size(), D});
  ContactArrays<Model, D> contacts(at.size());
  ErrorArrays errors(at.size(), with_errors);
  for (std::size_t c = 0; c < at.size(); ++c) {
    pair[c] = static_cast<std::int64_t>(at[c]);
    const Vec<D, S> r = pairs.separation(at[c]);
    write_vec(r, separation.row(c));
    contacts.set(c, found[c], pairs.first_body(at[c], r), pairs.second_body(at[c]));
    errors.set(
        c, [&] { return errors_at<Model, D>(in_doubles(found[c]), pairs.pair_in_long(at[c])); });
  }
  nb::dict result;
  result["pair"] = pair.release();
  result["separation"] = separation.release();
  contacts.release_to(result);
  errors.release_to(result);
  return result;
}

nb::tuple tuple_of(const ListedPairs &pairs, std::size_t D)
{
  NewArray<std::int64_t> particles({pairs.size(), 2}), shift({pairs.size(), D});
  std::copy(pairs.particles.begin(), pairs.particles.end(), particles.row(0));
  std::copy(pairs.shift.begin(), pairs.shift.end(), shift.row(0));
  return nb::make_tuple(particles.release(), shift.release());
}

nb::tuple near_spheres(const Array2<double> &centre, const Array1<double> &radius,
                       const Array2<double> &cell)
{
  const std::size_t n = centre.shape(0), space = centre.shape(1);
  require((space == 2 || space == 3) && radius.shape(0) == n && cell.shape(0) == space &&
              cell.shape(1) == space,
          "centre, radius and cell do not have shapes (N, D), (N,) and (D, D).");
  require_finite(centre, "centre");
  require_finite(radius, "radius");
  require_upper(cell.data(), space, "cell");
  return in_dimension(static_cast<int>(space), [&](auto D) {
    const std::vector<double> radii(radius.data(), radius.data() + n);
    return tuple_of(NearSpheres<D>(centre.data(), radii, cell.data()).find(), D);
  });
}

template <class Model> void export_pairs(nb::class_<ShapeOf<Model>> &of)
{
  using namespace nb::literals;
  using Self = const ShapeOf<Model> &;
  of.def(
      "near_particles",
      [](Self self, const Array3<double> &position, const Array3<double> &orientation,
         const Array3<double> &cell, double margin) {
        const PoseArrays arrays{position, orientation, cell};
        require_finite(margin, "margin");
        return self.in_space([&](auto D) {
          arrays.check(self.n(), D);
          return tuple_of(
              near_particles<Model, D>(self.shapes(), self.laws(), arrays.poses(), margin), D);
        });
      },
      "position"_a, "orientation"_a, "cell"_a, "margin"_a,
      "Pairs (M, 2) of particles whose surfaces may be closer than `margin`, with all images, and\n"
      "cell vectors (M, D) to add to the second, in ascending order.");
  def_over_pairs<double>(
      of, "near",
      [](Self self, const PairArrays &arrays, double margin) {
        require_finite(margin, "margin");
        return each_pair(self, arrays,
                         [&](const auto &of, std::size_t p) { return of.are_closer(p, margin); });
      },
      "margin"_a,
      "Whether surfaces of M pairs may be closer than `margin` (M,): false only if they are\n"
      "not. Poses and pairs in the format of `sums`.");
  def_over_pairs(
      of, "overlaps",
      [](Self self, const PairArrays &arrays) {
        return each_pair(self, arrays, [](const auto &of, std::size_t p) { return of.overlap(p); });
      },
      "Whether the particles of M pairs share more than a point (M,).");
  def_over_pairs<bool, bool>(
      of, "contacts",
      [](Self self, const PairArrays &arrays, bool extended, bool errors) {
        return self.in_space([&](auto D) {
          return extended ? contacts_in<Model, D, long double>(self, arrays, errors)
                          : contacts_in<Model, D, double>(self, arrays, errors);
        });
      },
      "extended"_a = false, "errors"_a = false,
      "The C of M pairs that are not apart, found in long double if extended. Returns a dict:\n"
      "pair (C,) rows of pairs; status (1 touching, 2 crossing, 3 unconverged), kind, n_bonds,\n"
      "energy (C,); separation, force (on i) (C, D); torque_i, torque_j (C, 1 or 3) and, of up to\n"
      "most_bonds bonds B, bond_normal (into i), bond_force, bond_arm_i (C, B, D),\n"
      "bond_distance, bond_reach, bond_energy, bond_stiffness (C, B), bond_on_side and\n"
      "bond_on_face (flat in all D - 1 directions) of i and j (C, B, 2). With errors, which takes\n"
      "longer, also bounds (C,) of the errors of energy, force and torques for exactly these\n"
      "particles, in their units: energy_error, due to the overlap; force_error, to overlap and\n"
      "normal; torque_error, to these and the point of contact; NaN without a contact.");
}

template <class Model> void export_shape(nb::module_ &m)
{
  using namespace nb::literals;
  using Self = ShapeOf<Model>;
  nb::class_<Self> of(m, class_name<Model>().c_str(), Model::SHAPE_RULE);
  const auto def_made_of = [&](auto numbers, const char *name, const char *text) {
    using Numbers = typename decltype(numbers)::type;
    of.def(
        "__init__",
        [](Self *self, const Array2<double> &diameters, const Numbers &its, int dimension,
           double k_e, int sides,
           double power) { new (self) Self(diameters, its, dimension, k_e, {sides, power}); },
        "diameters"_a, nb::arg(name), "dimension"_a, "k_e"_a, "sides"_a, "power"_a = HARMONIC,
        text);
    of.def(
        "__init__",
        [](Self *self, const Array2<double> &diameters, const Numbers &its, int dimension,
           const Array2<double> &k_e, const Array1<std::int64_t> &species, int sides,
           double power) {
          new (self) Self(diameters, its, dimension, k_e, species, {sides, power});
        },
        "diameters"_a, nb::arg(name), "dimension"_a, "k_e"_a, "species"_a, "sides"_a,
        "power"_a = HARMONIC,
        "The same with a symmetric k_e (T, T) by species (N,), numbered from 1.");
  };
  def_made_of(
      std::common_type<Array2<double>>(), "form",
      "Particles of diameters (N, 3) and further numbers (N, K), such as exponents; sides is\n"
      "1 or 2, the bonds of a side-to-side contact, for shapes whose law supports both; power is\n"
      "that of the overlap in the energy of a bond, at least 2.");
  def_made_of(std::common_type<Array1<double>>(), "exponent",
              "The same with exponents (N,), ignored by shapes without them.");
  of.attr("name") = Model::NAME;
  of.attr("core") = Model::CORE;
  of.attr("most_bonds") = Model::MOST_BONDS;
  of.attr("has_sides") = Model::HAS_SIDES;
  of.attr("bonds_are_contacts") = Model::BONDS_ARE_CONTACTS;
  export_sizes(of);
  export_pairs(of);
}

}  // namespace

void export_shapes(nb::module_ &m)
{
  using namespace nb::literals;
  m.def(
      "near_spheres", &near_spheres, "centre"_a, "radius"_a, "cell"_a,
      "Pairs (M, 2) of overlapping spheres of centres (N, D) and radii (N,), with all periodic\n"
      "images in the box of these cell vectors (D, D), as columns, and cell vectors (M, D) to add\n"
      "to the second, in ascending order.");
  Shapes::each([&](auto model) { export_shape<decltype(model)>(m); });
}

}  // namespace jamshape
