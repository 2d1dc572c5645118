#pragma once

#include "contact/math/vec.hpp"

#include <optional>
#include <type_traits>
#include <vector>

namespace jamshape {

/// Status of a pair. Two of these mean that no contact could be computed: CROSSING, where spines
/// (or centres) intersect and no normal exists, and UNCONVERGED, where an iteration ended without
/// usable bounds.
enum class ContactStatus { APART, TOUCHING, CROSSING, UNCONVERGED };

/// Classes of contact (Marschall & Teitel 2018, Fig. 1). The numbers are the column `kind` of
/// `compute contact/local` and of the Python bindings.
enum class ContactKind { TIP_TO_TIP = 0, TIP_TO_SIDE = 1, SIDE_TO_SIDE = 2 };

/// Number of bonds of a side-to-side contact, one or two, for shapes whose law supports both
/// (Marschall & Teitel 2018: one in the dynamics, Fig. 1d; two for minima and the dynamical matrix,
/// Fig. 6). Others ignore it.
enum class Sides { ONE = 1, TWO = 2 };

/// Numbers of a particle beside its three semi-axes, such as exponents: in LAMMPS by type, in
/// Python a row of `Packing.form`. A model makes its `Form` of them.
using FormNumbers = std::vector<double>;

/// The form of shapes that are given by their semi-axes alone.
struct NoForm {
  static std::optional<NoForm> from(const FormNumbers &numbers, int /*dimension*/)
  {
    return numbers.empty() ? std::optional<NoForm>(NoForm{}) : std::nullopt;
  }
};

/// Shapes whose contacts among themselves have a closed form and need no search.
enum class Shortcut { NONE, ROUND, ELLIPSOIDS };

/// Points closer than this times the distance of first touch coincide: no direction is left to push
/// along.
inline constexpr double COINCIDENT = 1e-14;

/// One point of contact that carries one force. Vectors are in space coordinates.
template <int D, class S = double> struct Bond {
  Vec<D, S> normal;      // unit, into i
  Vec<D, S> force;       // on i; j carries the opposite one
  Vec<D, S> arm_i;       // from the centre of i to the point of contact
  Torque<D, S> lever_i;  // derivative of the distance by a rotation of i
  Torque<D, S> lever_j;  // the same for a rotation of j
  S distance;            // the r of the overlap 1 - r/d
  S reach;               // the d of the overlap
  S energy;              // this bond's share of the contact's energy
  S stiffness;           // of the energy along the bond, without its coupling to other bonds
  S own_stiffness;       // contribution of this bond's overlap alone
  S coupling;            // to the contact's other bonds: `SecondDerivatives`
  bool on_side_i;        // the foot lies strictly inside the straight part of i
  bool on_side_j;
};

/// Whether a bond lies on a face of i, of j: a region of the surface that is flat in all D - 1
/// directions, so that a particle cannot roll over it (the side of a rod is one in 2D only).
struct OnFaces {
  bool i, j;
};

/// Energy of one pair with its exact derivatives: the force on i (j carries the opposite) and the
/// torques about the two centres. The model sets the maximum number of bonds.
template <int D, class S, int BONDS> struct Contact {
  static constexpr int MOST_BONDS = BONDS;
  ContactStatus status;
  ContactKind kind;
  int n_bonds;
  double gap;  // relative, between the bounds of the distance at the end of an iteration; else 0
  bool needs_digits;  // doubles are not precise enough: see to_its_digits
  Bond<D, S> bond[BONDS];
  S energy;
  Vec<D, S> force;
  Torque<D, S> torque_i;
  Torque<D, S> torque_j;
};

/// A contact without bonds; the bonds stay uninitialised, since most pairs of a list are apart.
template <int D, class S, int BONDS> Contact<D, S, BONDS> without_bonds(ContactStatus status)
{
  Contact<D, S, BONDS> contact;
  contact.status = status;
  contact.kind = ContactKind::TIP_TO_TIP;
  contact.n_bonds = 0;
  contact.gap = 0.0;
  contact.needs_digits = false;
  contact.energy = 0.0;
  contact.force = {};
  contact.torque_i = contact.torque_j = {};
  return contact;
}

/// The contact of two particles of a model.
template <class Model, int D, class S = double> using ContactOf = Contact<D, S, Model::MOST_BONDS>;

/// The contacts of as many pairs as a pack has lanes, without bonds: energies and their derivatives
/// of those that touch. A lane marked `alone` is of a rare kind and left to the code for single
/// pairs; `further` lanes, which may have a second bond, take longer and go into packs of their
/// own. Bodies that contacts cannot rotate have no torques.
template <int D, class S> struct CentralLanes {
  static constexpr bool HAS_TORQUES = false;
  S energy{0.0};
  Vec<D, S> force{};
  S bond_force{0.0};  // sum of the magnitudes
  Truth<S> touching, alone{}, further{}, two_bonds{};
};
template <int D, class S> struct ContactLanes : CentralLanes<D, S> {
  static constexpr bool HAS_TORQUES = true;
  Torque<D, S> torque_i{}, torque_j{};
};

/// Starting point of the search for a pair's next contact, remembered from the previous one: a
/// model's Start<D>. Shapes whose contacts need no search remember nothing.
struct NoStart {};

/// Whether a model's contacts need a search, for which doubles may not be precise enough.
template <class Model, int D>
inline constexpr bool IS_SEARCHED = !std::is_same_v<typename Model::template Start<D>, NoStart>;

/// Quantities that the drag on the substrate depends on (Marschall & Teitel 2018, Eqs. 8-12): a
/// particle's area (volume in 3D) and, for each body axis, the mean squared distance from that axis
/// over it (their I, Eq. 10, about z; in 2D those about x and y are of the flat body itself).
struct SubstrateDrag {
  double measure;
  Vec<3> moment;
};

}  // namespace jamshape
