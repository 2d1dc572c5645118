#pragma once

#include "contact/contact.hpp"
#include "contact/errors.hpp"

#include "bindings/arrays.hpp"

#include <optional>

namespace jamshape {

/// The contacts of n pairs as NumPy arrays (n, ...), their bonds as (n, BONDS, ...).
template <class Model, int D> class ContactArrays {
 public:
  explicit ContactArrays(std::size_t n) :
      status({n}), kind({n}), n_bonds({n}), energy({n}), force({n, D}), torque_i({n, ROTATIONS<D>}),
      torque_j({n, ROTATIONS<D>}), bond_normal({n, BONDS, D}), bond_force({n, BONDS, D}),
      bond_arm_i({n, BONDS, D}), bond_distance({n, BONDS}), bond_reach({n, BONDS}),
      bond_energy({n, BONDS}), bond_stiffness({n, BONDS}), bond_on_side({n, BONDS, 2}),
      bond_on_face({n, BONDS, 2})
  {
  }

  template <class S>
  void set(std::size_t n, const ContactOf<Model, D, S> &contact,
           const typename Model::template Body<D, S> &i,
           const typename Model::template Body<D, S> &j)
  {
    status[n] = static_cast<int>(contact.status);
    kind[n] = static_cast<int>(contact.kind);
    n_bonds[n] = contact.n_bonds;
    energy[n] = static_cast<double>(contact.energy);
    write_vec(contact.force, force.row(n));
    write_vec(contact.torque_i, torque_i.row(n));
    write_vec(contact.torque_j, torque_j.row(n));
    for (int b = 0; b < contact.n_bonds; ++b) {
      set_bond(n, b, contact.bond[b]);
      const OnFaces on = Model::on_faces(contact, b, i, j);
      bond_on_face.row(n)[2 * b] = on.i;
      bond_on_face.row(n)[2 * b + 1] = on.j;
    }
  }

  void release_to(nb::dict &result)
  {
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
    result["bond_reach"] = bond_reach.release();
    result["bond_energy"] = bond_energy.release();
    result["bond_stiffness"] = bond_stiffness.release();
    result["bond_on_side"] = bond_on_side.release();
    result["bond_on_face"] = bond_on_face.release();
  }

 private:
  static constexpr int BONDS = Model::MOST_BONDS;

  NewArray<int> status, kind, n_bonds;
  NewArray<double> energy, force, torque_i, torque_j, bond_normal, bond_force, bond_arm_i;
  NewArray<double> bond_distance, bond_reach, bond_energy, bond_stiffness;
  NewArray<bool> bond_on_side, bond_on_face;

  template <class S> void set_bond(std::size_t n, int b, const Bond<D, S> &bond)
  {
    write_vec(bond.normal, bond_normal.row(n) + b * D);
    write_vec(bond.force, bond_force.row(n) + b * D);
    write_vec(bond.arm_i, bond_arm_i.row(n) + b * D);
    bond_distance.row(n)[b] = static_cast<double>(bond.distance);
    bond_reach.row(n)[b] = static_cast<double>(bond.reach);
    bond_energy.row(n)[b] = static_cast<double>(bond.energy);
    bond_stiffness.row(n)[b] = static_cast<double>(bond.stiffness);
    bond_on_side.row(n)[2 * b] = bond.on_side_i;
    bond_on_side.row(n)[2 * b + 1] = bond.on_side_j;
  }
};

/// Bounds of the errors of n contacts, computed on request: they take longer than the contacts.
class ErrorArrays {
 public:
  ErrorArrays(std::size_t n, bool wanted)
  {
    if (wanted) arrays.emplace(n);
  }

  template <class Errors> void set(std::size_t n, const Errors &errors)
  {
    if (arrays.has_value()) arrays->set(n, errors());
  }

  void release_to(nb::dict &result)
  {
    if (!arrays.has_value()) return;
    result["energy_error"] = arrays->energy.release();
    result["force_error"] = arrays->force.release();
    result["torque_error"] = arrays->torque.release();
  }

 private:
  struct Arrays {
    NewArray<double> energy, force, torque;
    explicit Arrays(std::size_t n) : energy({n}), force({n}), torque({n}) {}
    void set(std::size_t n, const ContactErrors &errors)
    {
      energy[n] = errors.energy;
      force[n] = errors.force;
      torque[n] = errors.torque;
    }
  };
  std::optional<Arrays> arrays;
};

}  // namespace jamshape
