#pragma once

#include "contact/along_x.hpp"
#include "contact/compiled_once.hpp"
#include "contact/contact.hpp"
#include "contact/instruction_set.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/packs.hpp"
#include "contact/power_law.hpp"
#include "contact/spherocylinder/segment_segment.hpp"
#include "contact/spherocylinder/side_to_side.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace jamshape {

/// A segment of length 2A (the spine) along the body's x, thickened by R. A = 0 is a disc (a
/// sphere).
struct Spherocylinder {
  double half_length;
  double radius;
};

/// Area 4AR + pi R^2 in 2D, volume in 3D, and their moments. In 2D about z: Marschall & Teitel
/// 2018, Eq. 10, here as the sum over the rectangle and the two half discs (each with its centroid
/// 4R/(3 pi) beyond the end of the spine; 3R/8 for the half balls of 3D).
template <int D> SubstrateDrag substrate_drag(const Spherocylinder &shape);

template <> inline SubstrateDrag substrate_drag<2>(const Spherocylinder &shape)
{
  const double A = shape.half_length, R = shape.radius;
  const double side = 4.0 * A * R, caps = M_PI * R * R;
  const double about_z =
      side * (A * A + R * R) / 3.0 + caps * (0.5 * R * R + A * A + 8.0 * A * R / (3.0 * M_PI));
  const double about_x = side * R * R / 3.0 + caps * 0.25 * R * R;
  const double about_y =
      side * A * A / 3.0 + caps * (0.25 * R * R + A * A + 8.0 * A * R / (3.0 * M_PI));
  const double area = side + caps;
  return {area, {{about_x / area, about_y / area, about_z / area}}};
}

template <> inline SubstrateDrag substrate_drag<3>(const Spherocylinder &shape)
{
  const double A = shape.half_length, R = shape.radius;
  const double side = 2.0 * A * M_PI * R * R, caps = 4.0 / 3.0 * M_PI * R * R * R;
  const double along = side * 0.5 * R * R + caps * 0.4 * R * R;
  const double across =
      side * (0.25 * R * R + A * A / 3.0) + caps * (0.4 * R * R + A * A + 0.75 * A * R);
  const double volume = side + caps;
  return {volume, {{along / volume, across / volume, across / volume}}};
}

template <int D, class S = double> using SpherocylinderBody = BodyAlongX<Spherocylinder, D, S>;

template <class K> struct SpherocylinderLawOf {
  PowerLawOf<K> bond;
  Sides sides;
  bool shortcuts;  // false: also discs by the search for feet
  /// In 2D a tip, as numbered by `TipFeet`: the farther end of two bonds, or the single bond, is
  /// there, although another one may be closer. Then the energy has no kink.
  int tip = NO_TIP;
};
using SpherocylinderLaw = SpherocylinderLawOf<double>;

/// Below this |sin| of the angle between them two spines count as parallel: their single bond acts
/// at the middle of the overlap of the spines (Marschall & Teitel 2018, Sec. II, taken modulo pi).
inline constexpr double PARALLEL_SINE = 1e-8;

template <int D, class S>
SpinePair<D, S> spine_pair(const SpherocylinderBody<D, S> &i, const SpherocylinderBody<D, S> &j)
{
  return {i.centre - j.centre, i.axis, i.half_length, j.axis, j.half_length};
}

/// Class of a contact with one bond. Two feet inside the flat portions occur only for skew rods in
/// 3D.
template <int D, class S> ContactKind kind_of(const SpinePair<D, S> &p, const Feet<D, S> &feet)
{
  const bool on_i = abs(feet.s) < p.A_i, on_j = abs(feet.t) < p.A_j;
  if (on_i && on_j) return ContactKind::SIDE_TO_SIDE;
  return on_i || on_j ? ContactKind::TIP_TO_SIDE : ContactKind::TIP_TO_TIP;
}

/// Contact of two spherocylinders in 2D or 3D. With overlaps a of the shortest distance of the
/// spines and b at the far end of their facing portions, E the law of a bond:
///     Sides::ONE  V = E(a)                                  (Marschall & Teitel 2018, Eqs. 3, 5,
///     22) Sides::TWO  V = (E(a)^(1/w) + E(b)^(1/w))^w, E(a) where b <= 0
/// w is the `EndExponent`: 1, the paper's two bonds (Fig. 6), for overlaps far below A_min^2 / d of
/// spines opposite each other by more than A_min / 20; towards 0 where they cease to be, as the
/// norm becomes E(a). So E(a) <= V <= 2 E(a), without the jumps of the paper's rule, and the same
/// with the two ends exchanged.
///
/// Force and torques are its exact derivatives. The remaining kinks are where the nearer tip of the
/// far end changes, of relative size of the angle between the rods; and in 3D, for twisted rods, of
/// full strength. Exactly parallel rods with Sides::ONE sit on a kink: the lever arm is the middle
/// of the overlap of the spines, which lies between both sides' and is the same for i, j exchanged.
template <int D, class S> class SpherocylinderContact {
 public:
  using Found = Contact<D, S, 2>;

  SpherocylinderContact(const SpherocylinderBody<D, S> &i, const SpherocylinderBody<D, S> &j,
                        const SpherocylinderLawOf<Plain<S>> &contact_law) :
      SpherocylinderContact(spine_pair(i, j), i.radius, j.radius, contact_law)
  {
  }
  SpherocylinderContact(const SpinePair<D, S> &spines, const Plain<S> &R_i, const Plain<S> &R_j,
                        const SpherocylinderLawOf<Plain<S>> &contact_law) :
      pair(spines), radius_i(R_i), reach(R_i + R_j), inverse_reach(S(1.0) / reach), law(contact_law)
  {
  }

  Found evaluate() const
  {
    if (pair.A_i == 0.0 && pair.A_j == 0.0 && law.shortcuts) return discs();
    const auto &values = values_of(pair);
    const auto closest = closest_feet(values);
    if (!touches(closest.distance_sq)) return without(ContactStatus::APART);
    if (is_coincident(closest) || spines_cross(values)) return without(ContactStatus::CROSSING);
    if (law.tip != NO_TIP) return law.sides == Sides::TWO ? two_bonds() : bond_at_tip();
    if (law.sides == Sides::TWO && far_ends_may_touch(values, closest, reach)) return two_bonds();
    if constexpr (std::is_same_v<S, ValueOf<S>>) {
      return one_bond(closest);
    } else {
      return one_bond(closest_feet(pair));
    }
  }

  /// The tip where the farther end of two bonds is, or the single one of rods with sides one.
  int tip() const
  {
    if (pair.A_i == 0.0 && pair.A_j == 0.0) return NO_TIP;
    const auto closest = closest_feet(pair);
    if (!touches(closest.distance_sq) || is_coincident(closest) || spines_cross(pair))
      return NO_TIP;
    if (law.sides == Sides::ONE) return TipFeet<D, S>(pair).nearest();
    if (!far_ends_may_touch(pair, closest, reach)) return NO_TIP;
    const EndFeet<D, S> ends(pair);
    return touches(ends.farther().distance_sq) ? ends.tip_of_farther() : NO_TIP;
  }

  /// Evaluates lanes that `evaluate_lanes` left, which may have a second bond: two full ones or
  /// one. Those that share an energy are left to `evaluate_shared_lanes`.
  ContactLanes<D, S> evaluate_far_lanes() const
  {
    const EndFeet<D, S> ends(pair);
    const Feet<D, S> closest = closest_to_end(pair, ends.nearer()), far_end = ends.farther();
    ContactLanes<D, S> lanes;
    lanes.touching = touches(closest.distance_sq);
    const S distance = sqrt(closest.distance_sq);
    const Truth<S> far = lanes.touching & touches(far_end.distance_sq);
    if (any(far)) add_far_ends(lanes, far, distance, far_end);
    lanes.bond_force += add_load(lanes, closest, distance, whole()).size;
    return lanes;
  }

  /// Evaluates lanes that `evaluate_far_lanes` left.
  ContactLanes<D, S> evaluate_shared_lanes() const
  {
    const EndFeet<D, S> ends(pair);
    const Feet<D, S> closest = closest_to_end(pair, ends.nearer()), far_end = ends.farther();
    const S mean = overlap_at(0.5 * (sqrt(closest.distance_sq) + sqrt(far_end.distance_sq)));
    const EndExponent<S> w(pair, SideBySide<S>(pair, mean, reach));
    const Sharing of = shared_by(closest, far_end, w);
    ContactLanes<D, S> lanes;
    lanes.touching = touches(closest.distance_sq);
    lanes.two_bonds = lanes.touching & (of.far.share > S(LEAST_SHARE));
    lanes.alone = !(w.value > S(LEAST_END_EXPONENT));
    const Load near = add_load(lanes, closest, of.distance, of.near);
    const Load far = add_load(lanes, far_end, of.far_distance, of.far);
    add_sharing(lanes, of);
    lanes.bond_force = norm(near.force + 0.5 * of.push) + norm(far.force + 0.5 * of.push);
    return lanes;
  }

  /// Evaluates lanes with one bond, except the rare ones.
  ContactLanes<D, S> evaluate_lanes() const
  {
    const Truth<S> round = (pair.A_i == S(0.0)) & (pair.A_j == S(0.0));
    const Feet<D, S> closest =
        law.shortcuts && all(round) ? feet_at(pair, S(0.0), S(0.0)) : closest_feet(pair);
    ContactLanes<D, S> lanes;
    lanes.touching = touches(closest.distance_sq);
    if (!any(lanes.touching)) return lanes;
    lanes.alone = is_coincident(closest) | spines_cross(pair);
    if (law.sides == Sides::ONE) lanes.alone = lanes.alone | (is_parallel() & !round);
    lanes.alone = lanes.touching & lanes.alone;
    if (law.sides == Sides::TWO) {
      lanes.further =
          lanes.touching & !(lanes.alone | round) & far_ends_may_touch(pair, closest, reach);
    }
    lanes.bond_force += add_load(lanes, closest, sqrt(closest.distance_sq), whole()).size;
    return lanes;
  }

  /// Evaluates lanes of discs (spheres).
  CentralLanes<D, S> evaluate_round_lanes() const
  {
    const Feet<D, S> centres = feet_of_discs();
    CentralLanes<D, S> lanes;
    lanes.touching = touches(centres.distance_sq);
    lanes.alone = lanes.touching & is_coincident(centres);
    lanes.bond_force = add_central(lanes, centres, sqrt(centres.distance_sq), whole()).size;
    return lanes;
  }

 private:
  SpinePair<D, S> pair;
  Plain<S> radius_i, reach;
  S inverse_reach;
  SpherocylinderLawOf<Plain<S>> law;

  /// Contribution of a bond to the energy: its `share`, a factor of the harmonic law of its own
  /// overlap, the additional derivative of the energy with respect to its overlap (`slope`), and
  /// its `coupling`.
  struct Part {
    S share, slope, coupling;
  };
  static Part whole() { return {1.0, 0.0, 0.0}; }

  static Found without(ContactStatus status)
  {
    return without_bonds<D, S, Found::MOST_BONDS>(status);
  }

  template <class T> Truth<T> touches(const T &distance_sq) const
  {
    return distance_sq < T(reach) * reach;
  }

  Truth<S> is_parallel() const { return abs_sine(pair) < S(PARALLEL_SINE); }

  template <class T> Truth<T> is_coincident(const Feet<D, T> &feet) const
  {
    return feet.distance_sq <= COINCIDENT * reach * COINCIDENT * reach;
  }

  Feet<D, S> feet_of_discs() const { return {S(0.0), S(0.0), pair.r, norm_sq(pair.r)}; }

  /// Result of the general path for two spines of zero length, without the search for feet.
  Found discs() const
  {
    const Feet<D, S> centres = feet_of_discs();
    if (!touches(centres.distance_sq)) return without(ContactStatus::APART);
    if (is_coincident(centres)) return without(ContactStatus::CROSSING);
    Found contact = without(ContactStatus::TOUCHING);
    add_bond(contact, centres, sqrt(centres.distance_sq), whole());
    return contact;
  }

  Found one_bond(const Feet<D, S> &closest) const
  {
    Found contact = without(ContactStatus::TOUCHING);
    const S distance = sqrt(closest.distance_sq);
    if (law.sides == Sides::ONE && is_parallel()) {
      const EndFeet<D, S> ends(pair);
      if (ends.are_apart()) {
        contact.kind = ContactKind::SIDE_TO_SIDE;
        // The energy stays that of the shortest distance, so that it does not jump at
        // PARALLEL_SINE.
        add_bond(contact, ends.middle(pair), distance, whole());
        return contact;
      }
    }
    contact.kind = kind_of(pair, closest);
    add_bond(contact, closest, distance, whole());
    return contact;
  }

  Found bond_at_tip() const
  {
    const Feet<D, S> feet = TipFeet<D, ValueOf<S>>(values_of(pair)).feet(pair, law.tip);
    if (!touches(feet.distance_sq)) return without(ContactStatus::APART);
    Found contact = without(ContactStatus::TOUCHING);
    contact.kind = kind_of(pair, feet);
    add_bond(contact, feet, sqrt(feet.distance_sq), whole());
    return contact;
  }

  S overlap_at(const S &distance) const { return (reach - distance) * inverse_reach; }

  Found two_bonds() const
  {
    const EndFeet<D, S> ends(pair, law.tip);
    const Feet<D, S> closest = closest_to_end(pair, ends.nearer());  // never the farther, at a tie
    const Feet<D, S> &far_end = ends.farther();
    const S distance = sqrt(closest.distance_sq);
    Found contact = without(ContactStatus::TOUCHING);
    const S far_distance = sqrt(far_end.distance_sq);
    if (far_distance < reach) {
      const S mean = overlap_at(0.5 * (distance + far_distance));
      const SideBySide<ValueOf<S>> at(values_of(pair), value_of(mean), reach);
      if (at.has_two_bonds()) {
        contact.kind = ContactKind::SIDE_TO_SIDE;
        add_bond(contact, closest, distance, whole());
        add_bond(contact, far_end, far_distance, whole());
        return contact;
      }
      if (!at.has_one_bond()) {
        const EndExponent<S> w(pair, SideBySide<S>(pair, mean, reach));
        if (w.value > LEAST_END_EXPONENT) return side_to_side(closest, far_end, w);
      }
    }
    contact.kind = kind_of(pair, closest);
    add_bond(contact, closest, distance, whole());
    return contact;
  }

  /// Additional loads of two bonds that share an energy: `push` on i, and the torques on both.
  struct Sharing {
    S distance, far_distance;
    Part near, far;
    Vec<D, S> push;
    Torque<D, S> turn_i, turn_j;
  };

  Sharing shared_by(const Feet<D, S> &closest, const Feet<D, S> &far_end,
                    const EndExponent<S> &w) const
  {
    const S log_ratio = log_ratio_of(pair, closest, far_end, reach);
    const EndNorm<S> norm(log_ratio, w.value, law.bond.power);
    // In dual numbers the derivatives of the shares with respect to the overlaps are left out:
    // `coupling` accounts for them.
    const EndNorm<S> fixed(constant(log_ratio), w.value, law.bond.power);
    const S distance = sqrt(closest.distance_sq), far_distance = sqrt(far_end.distance_sq);
    const S energy = norm.share_a * law.bond.energy(overlap_at(distance)) +
                     norm.share_b * law.bond.energy(overlap_at(far_distance));
    const S by_exponent = energy * norm.entropy, by_overlap = 0.5 * by_exponent * w.by_mean;
    // Coefficient of the norm's exponent over the overlaps, less that of two bonds.
    const ValueOf<S> curved = most(ValueOf<S>(2.0 / value_of(w.value) - 2.0), ValueOf<S>(0.0));
    const auto root = [&](const S &apart, const S &fraction) {
      const ValueOf<S> stiffness = law.bond.energy_hessian(value_of(overlap_at(apart)));
      return sqrt(law.bond.steepness() * curved * stiffness) * value_of(inverse_reach) *
             sqrt(value_of(fraction));
    };
    const ValueOf<S> coupling_a = root(distance, fixed.part_b * fixed.share_a);
    const ValueOf<S> coupling_b = -root(far_distance, fixed.part_a * fixed.share_b);

    const S per_i = by_exponent * w.by_along_i, per_j = by_exponent * w.by_along_j;
    const Torque<D, S> turn = (by_exponent * w.by_cosine) * cross(pair.u_i, pair.u_j);
    return {distance,
            far_distance,
            {fixed.share_a, by_overlap, coupling_a},
            {fixed.share_b, by_overlap, coupling_b},
            -1.0 * (per_i * pair.u_i + per_j * pair.u_j),
            per_i * cross(pair.u_i, pair.r) + turn,
            per_j * cross(pair.u_j, pair.r) - turn};
  }

  template <class To> static void add_sharing(To &to, const Sharing &of)
  {
    to.force += of.push;
    to.torque_i -= of.turn_i;
    to.torque_j -= of.turn_j;
  }

  Found side_to_side(const Feet<D, S> &closest, const Feet<D, S> &far_end,
                     const EndExponent<S> &w) const
  {
    const Sharing of = shared_by(closest, far_end, w);
    Found contact = without(ContactStatus::TOUCHING);
    contact.kind = ContactKind::SIDE_TO_SIDE;
    add_bond(contact, closest, of.distance, of.near);
    if (value_of(of.far.share) > LEAST_SHARE) add_bond(contact, far_end, of.far_distance, of.far);
    add_sharing(contact, of);
    for (Bond<D, S> &bond : contact.bond) bond.force += 0.5 * of.push;
    return contact;
  }

  /// Adds the second bond of lanes with two full bonds to those whose far ends touch.
  void add_far_ends(ContactLanes<D, S> &lanes, const Truth<S> &far, const S &distance,
                    const Feet<D, S> &far_end) const
  {
    const S far_distance = sqrt(far_end.distance_sq);
    const SideBySide<S> at(pair, overlap_at(0.5 * (distance + far_distance)), reach);
    lanes.two_bonds = far & at.has_two_bonds();
    lanes.further = far & !lanes.two_bonds & !at.has_one_bond();
    const S distance_of_second = select(lanes.two_bonds, far_distance, S(reach));
    lanes.bond_force += add_load(lanes, far_end, distance_of_second, whole()).size;
  }

  /// Contribution of a bond to a contact's energy, force and torques.
  struct Load {
    Vec<D, S> normal, force;
    S overlap, size, energy;
  };
  template <class To>
  Load add_load(To &to, const Feet<D, S> &feet, const S &distance, const Part &part) const
  {
    const Load load = add_central(to, feet, distance, part);
    to.torque_i += feet.s * cross(pair.u_i, load.force);
    to.torque_j -= feet.t * cross(pair.u_j, load.force);
    return load;
  }
  /// The same without torques.
  template <class To>
  Load add_central(To &to, const Feet<D, S> &feet, const S &distance, const Part &part) const
  {
    const S overlap = overlap_at(distance);
    const Vec<D, S> normal = (1.0 / sqrt(feet.distance_sq)) * feet.delta;
    // In dual numbers the slope of the law is left out here: `own_stiffness` accounts for it, so
    // that the derivatives of force and torque hold the small remainder, not its sum with a large
    // number.
    const S slope = part.share * law.bond.energy_gradient(constant(overlap)) + part.slope;
    const S size = slope * inverse_reach;
    const Vec<D, S> force = size * normal;
    const S energy = part.share * law.bond.energy(overlap);
    to.energy += energy;
    to.force += force;
    return {normal, force, overlap, size, energy};
  }

  /// Adds a bond with the lever arms of `feet` and the overlap of `distance`. Any point on the line
  /// of `feet` gives the same torque; the reported one lies inside the overlap.
  void add_bond(Found &contact, const Feet<D, S> &feet, const S &distance, const Part &part) const
  {
    const Load load = add_load(contact, feet, distance, part);
    Bond<D, S> &bond = contact.bond[contact.n_bonds++];
    bond.normal = load.normal;
    bond.force = load.force;
    // Derivatives of these are never needed.
    const auto &values = values_of(pair);
    const auto along = values_of(load.normal);
    const auto depth = radius_i * value_of(distance) * value_of(inverse_reach);
    bond.arm_i = constants_of<S>(value_of(feet.s) * values.u_i - depth * along);
    bond.lever_i = constants_of<S>(value_of(feet.s) * cross(values.u_i, along));
    bond.lever_j = constants_of<S>(-value_of(feet.t) * cross(values.u_j, along));
    bond.distance = distance;
    bond.reach = reach;
    bond.energy = load.energy;
    const S bend = law.bond.energy_hessian(load.overlap) * inverse_reach * inverse_reach;
    bond.stiffness = bond.own_stiffness = part.share * bend;
    bond.coupling = part.coupling;
    bond.on_side_i = abs(feet.s) < pair.A_i;
    bond.on_side_j = abs(feet.t) < pair.A_j;
  }
};

template <int D, class S>
Contact<D, S, 2> contact_of(const SpherocylinderBody<D, S> &i, const SpherocylinderBody<D, S> &j,
                            const SpherocylinderLaw &law)
{
  return SpherocylinderContact<D, S>(i, j, law).evaluate();
}

/// Together with AlongX, all that pair styles, Python and sums over pairs need to know about a
/// shape; every shape has one such struct (see ARCHITECTURE.md, how to add a shape).
struct SpherocylinderModel : AlongX<Spherocylinder> {
  using Law = SpherocylinderLaw;

  static constexpr const char *NAME = "spherocylinder";
  static constexpr const char *SHAPE_RULE =
      "a spherocylinder has diameters (2(A+R), 2R, 2R), its long axis the body's x";
  /// Name of the core that must not cross that of another particle.
  static constexpr const char *CORE = "spines";
  /// Bonds of a contact, and whether `sides` changes the law.
  static constexpr int MOST_BONDS = 2;
  static constexpr bool HAS_SIDES = true;
  /// Whether each bond constrains a particle like a separate contact; two bonds side to side are
  /// one contact.
  static constexpr bool BONDS_ARE_CONTACTS = false;

  /// Without shortcuts, the search also runs for particles whose contacts have a closed form.
  static Law law(const PowerLaw &bond, Sides sides, bool shortcuts = true)
  {
    return {bond, sides, shortcuts};
  }

  /// In 2D the energy of a pair is the largest of several smooth pieces near its kinks, one for
  /// each tip. The number of the one that it lies on; -1 without a contact that may have a kink.
  template <int D> static constexpr bool HAS_KINKS = D == 2;
  template <int D> static int piece(const Body<D> &i, const Body<D> &j, const Law &law)
  {
    return SpherocylinderContact<D, double>(i, j, law).tip();
  }
  /// The law of one of these pieces.
  static Law on_piece(const Law &law, int piece)
  {
    Law of_piece = law;
    of_piece.tip = piece;
    return of_piece;
  }

  /// Class of shapes whose contacts have a closed form.
  template <int D> static Shortcut shortcut(const Shape &shape)
  {
    return shape.half_length > 0.0 ? Shortcut::NONE : Shortcut::ROUND;
  }

  template <int D> static SubstrateDrag drag(const Shape &shape)
  {
    return substrate_drag<D>(shape);
  }

  /// Faces of bond b of a contact.
  template <int D, class S>
  static OnFaces on_faces(const Contact<D, S, MOST_BONDS> &contact, int b, const Body<D, S> &,
                          const Body<D, S> &)
  {
    if (D == 3) return {false, false};
    const bool is_between = contact.kind == ContactKind::SIDE_TO_SIDE;
    return {is_between || contact.bond[b].on_side_i, is_between || contact.bond[b].on_side_j};
  }

  /// Whether the gap between the surfaces of i and j is smaller than `margin`.
  template <int D> static bool closer_than(double margin, const Body<D> &i, const Body<D> &j)
  {
    const double reach = i.radius + j.radius + margin;
    return spheres_are_closer<D>(margin, i, j) &&
           spine_distance_sq(spine_pair(i, j)) < reach * reach;
  }
};

/// Compiled in packs.cpp for each instruction set.
template <InstructionSet SET, int D> FindContacts<SpherocylinderModel, D> find_rod_contacts;

template <int D> struct PacksOf<SpherocylinderModel, D> {
  static constexpr bool EXIST = true, CHOOSE = true;
  static bool take(const Spherocylinder &, const Spherocylinder &) { return true; }

  static FindContacts<SpherocylinderModel, D> *of(InstructionSet set)
  {
    return compiled_for(set, [](auto one) { return &find_rod_contacts<decltype(one)::value, D>; });
  }
};

/// Whether two bodies share more than a point: for Monte Carlo of hard particles.
template <int D>
bool are_overlapping(const SpherocylinderBody<D> &i, const SpherocylinderBody<D> &j)
{
  return SpherocylinderModel::closer_than<D>(0.0, i, j);
}

JAMSHAPE_CONTACTS(extern, SpherocylinderModel)

}  // namespace jamshape
