#include "contact/spherocylinder/spherocylinder.hpp"

#include "bindings/arrays.hpp"
#include "bindings/laws.hpp"
#include "bindings/pairs.hpp"

namespace jamshape {

namespace {

using Bodies = Array2<double>;

template <int D> SpherocylinderBody<D> body_at(const Bodies &bodies, std::size_t n)
{
  const double *row = bodies.data() + n * bodies.shape(1);
  return {read_vec<D>(row), read_vec<D>(row + D), row[2 * D], row[2 * D + 1]};
}

int dimension_of(const Bodies &bodies)
{
  const std::size_t columns = bodies.shape(1);
  require(columns == 6 || columns == 8,
          "bodies have " + std::to_string(columns) +
              " columns, expected 6 (2D) or 8 (3D): centre, axis, half_length, radius.");
  return columns == 6 ? 2 : 3;
}

void require_same_shape(const Bodies &i, const Bodies &j)
{
  require(i.shape(0) == j.shape(0) && i.shape(1) == j.shape(1),
          "bodies_i and bodies_j differ in shape, expected one row each a pair.");
}

template <int D>
nb::dict contacts(const Bodies &bodies_i, const Bodies &bodies_j, const SpherocylinderLaw &law)
{
  const std::size_t n_pairs = bodies_i.shape(0), torques = ROTATIONS<D>;
  NewArray<int> status({n_pairs}), kind({n_pairs}), n_bonds({n_pairs});
  NewArray<double> energy({n_pairs}), force({n_pairs, D});
  NewArray<double> torque_i({n_pairs, torques}), torque_j({n_pairs, torques});
  NewArray<double> bond_normal({n_pairs, 2, D}), bond_force({n_pairs, 2, D});
  NewArray<double> bond_arm_i({n_pairs, 2, D}), bond_distance({n_pairs, 2});
  NewArray<double> bond_energy({n_pairs, 2});
  NewArray<bool> on_side_i({n_pairs, 2}), on_side_j({n_pairs, 2});

  for (std::size_t n = 0; n < n_pairs; ++n) {
    const Contact<D> contact = contact_of(body_at<D>(bodies_i, n), body_at<D>(bodies_j, n), law);
    status[n] = static_cast<int>(contact.status);
    kind[n] = static_cast<int>(contact.kind);
    n_bonds[n] = contact.n_bonds;
    energy[n] = contact.energy;
    write_vec(contact.force, force.row(n));
    write_vec(contact.torque_i, torque_i.row(n));
    write_vec(contact.torque_j, torque_j.row(n));
    for (int b = 0; b < contact.n_bonds; ++b) {
      const Bond<D> &bond = contact.bond[b];
      write_vec(bond.normal, bond_normal.row(n) + b * D);
      write_vec(bond.force, bond_force.row(n) + b * D);
      write_vec(bond.arm_i, bond_arm_i.row(n) + b * D);
      bond_distance.row(n)[b] = bond.distance;
      bond_energy.row(n)[b] = bond.energy;
      on_side_i.row(n)[b] = bond.on_side_i;
      on_side_j.row(n)[b] = bond.on_side_j;
    }
  }

  nb::dict result;
  result["status"] = status.release();
  result["kind"] = kind.release();
  result["n_bonds"] = n_bonds.release();
  result["energy"] = energy.release();
  result["force"] = force.release();
  result["torque_i"] = torque_i.release();
  result["torque_j"] = torque_j.release();
  result["bond_normal"] = bond_normal.release();
  result["bond_force"] = bond_force.release();
  result["bond_arm_i"] = bond_arm_i.release();
  result["bond_distance"] = bond_distance.release();
  result["bond_energy"] = bond_energy.release();
  result["bond_on_side_i"] = on_side_i.release();
  result["bond_on_side_j"] = on_side_j.release();
  return result;
}

nb::dict spherocylinder_contacts(const Bodies &bodies_i, const Bodies &bodies_j, double k_e,
                                 int sides)
{
  require_same_shape(bodies_i, bodies_j);
  const SpherocylinderLaw law = spherocylinder_law(k_e, sides);
  return dimension_of(bodies_i) == 2 ? contacts<2>(bodies_i, bodies_j, law)
                                     : contacts<3>(bodies_i, bodies_j, law);
}

nb::dict spherocylinder_sums(const Array2<double> &diameters, const Array3<double> &position,
                             const Array3<double> &orientation, const Array2<double> &edges,
                             const Array2<std::int64_t> &pairs, const Array2<std::int64_t> &shift,
                             double k_e, int sides, bool extended)
{
  return pair_sums<SpherocylinderModel>({diameters, position, orientation, edges, pairs, shift},
                                        spherocylinder_law(k_e, sides), extended);
}

nb::dict spherocylinder_derivatives(const Array2<double> &diameters, const Array3<double> &position,
                                    const Array3<double> &orientation, const Array2<double> &edges,
                                    const Array2<std::int64_t> &pairs,
                                    const Array2<std::int64_t> &shift, double k_e, int sides,
                                    bool extended)
{
  return pair_derivatives<SpherocylinderModel>(
      {diameters, position, orientation, edges, pairs, shift}, spherocylinder_law(k_e, sides),
      extended);
}

template <int D>
void fill_distances(const Bodies &bodies_i, const Bodies &bodies_j, NewArray<double> &distance)
{
  for (std::size_t n = 0; n < bodies_i.shape(0); ++n) {
    const SpinePair<D> pair = spine_pair(body_at<D>(bodies_i, n), body_at<D>(bodies_j, n));
    distance[n] = std::sqrt(spine_distance_sq(pair));
  }
}

nb::object spine_distances(const Bodies &bodies_i, const Bodies &bodies_j)
{
  require_same_shape(bodies_i, bodies_j);
  NewArray<double> distance({bodies_i.shape(0)});
  if (dimension_of(bodies_i) == 2) {
    fill_distances<2>(bodies_i, bodies_j, distance);
  } else {
    fill_distances<3>(bodies_i, bodies_j, distance);
  }
  return distance.release();
}

nb::tuple spherocylinder_drag(const Array1<double> &half_length, const Array1<double> &radius,
                              int dimension)
{
  const std::size_t n_particles = half_length.shape(0);
  require(radius.shape(0) == n_particles, "half_length and radius differ in length.");
  require(dimension == 2 || dimension == 3,
          "dimension is " + std::to_string(dimension) + ", expected 2 or 3.");
  NewArray<double> measure({n_particles}), moment({n_particles, 3});
  for (std::size_t n = 0; n < n_particles; ++n) {
    const Spherocylinder shape{half_length.data()[n], radius.data()[n]};
    const SubstrateDrag drag = dimension == 2 ? substrate_drag<2>(shape) : substrate_drag<3>(shape);
    measure[n] = drag.measure;
    write_vec(drag.moment, moment.row(n));
  }
  return nb::make_tuple(measure.release(), moment.release());
}

}  // namespace

void export_spherocylinder(nb::module_ &m)
{
  using namespace nb::literals;
  m.def(
      "spherocylinder_contacts", &spherocylinder_contacts, "bodies_i"_a, "bodies_j"_a, "k_e"_a,
      "sides"_a,
      "Contacts of M pairs. Bodies are (M, 6) in 2D, (M, 8) in 3D: centre, unit axis, "
      "half_length,\n"
      "radius. Returns a dict of arrays: status (0 apart, 1 touching, 2 crossing), kind, n_bonds,\n"
      "energy, force (on i), torque_i, torque_j and, of up to two bonds, bond_normal (into i),\n"
      "bond_force, bond_arm_i, bond_distance, bond_energy, bond_on_side_i, bond_on_side_j.");
  m.def("spherocylinder_sums", &spherocylinder_sums, "diameters"_a, "position"_a, "orientation"_a,
        "edges"_a, "pairs"_a, "shift"_a, "k_e"_a, "sides"_a, "extended"_a,
        "Sums over M pairs of N particles. Diameters (N, 3); position (2, N, D), orientation (2, "
        "N, 1)\n"
        "angles or (2, N, 4) quaternions and edges (2, D) as a double and its small rest; pairs\n"
        "(M, 2), shift (M, D) box edges to add to the second; extended: in long double. Returns a\n"
        "dict: energy, force (N, D), torque (N, 1 or 3), virial (D, D), bond_force (sum of\n"
        "magnitudes), n_bonds, crossing and unconverged (a pair of this status, or -1).");
  m.def("spherocylinder_derivatives", &spherocylinder_derivatives, "diameters"_a, "position"_a,
        "orientation"_a, "edges"_a, "pairs"_a, "shift"_a, "k_e"_a, "sides"_a, "extended"_a,
        "Second derivatives of the C touching pairs, arguments as in spherocylinder_sums. The\n"
        "variables are r_i - r_j and the rotations of i and j, n = 4 in 2D, 9 in 3D. Returns a "
        "dict:\n"
        "pair (C,) rows of pairs; n_bonds, kind, energy (C,); separation, force (C, D); of up to "
        "two\n"
        "bonds stiffness, distance, bond_force (C, 2), on_side (C, 2, 2) and gradient (C, 2, n) of "
        "the\n"
        "distance;\n"
        "curvature (C, n, n), all but stiffness gradient (x) gradient.");
  m.def("spine_distances", &spine_distances, "bodies_i"_a, "bodies_j"_a,
        "Shortest distances (M,) of the spines of M pairs, 0 where they cross.");
  m.def("spherocylinder_drag", &spherocylinder_drag, "half_length"_a, "radius"_a, "dimension"_a,
        "Area (volume in 3D) (N,) and moments per body axis (N, 3), in units of length squared.");
}

}  // namespace jamshape
