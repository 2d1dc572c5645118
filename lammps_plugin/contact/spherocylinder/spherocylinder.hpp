#pragma once

#include "contact/along_x.hpp"
#include "contact/contact.hpp"
#include "contact/harmonic.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
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
  const double area = side + caps;
  return {area, {{0.0, 0.0, about_z / area}}};
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

struct SpherocylinderLaw {
  Harmonic harmonic;
  Sides sides;
  bool shortcuts;  // false: discs by the search for feet, too
};

/// Below this |sin| of the angle between them two spines are parallel: their one bond sits in the
/// middle of the overlap of the spines (Marschall & Teitel 2018, Sec. II, taken modulo pi).
inline constexpr double PARALLEL_SINE = 1e-8;

template <int D, class S>
SpinePair<D, S> spine_pair(const SpherocylinderBody<D, S> &i, const SpherocylinderBody<D, S> &j)
{
  return {i.centre - j.centre, i.axis, i.half_length, j.axis, j.half_length};
}

/// Gradient of an energy of the pair with respect to r and to rotations of i and j.
template <int D, class S> struct PairGradient {
  Vec<D, S> r;
  Torque<D, S> rotation_i;
  Torque<D, S> rotation_j;
};

/// Adds what a weight does, from the energy's derivative by it.
template <int D, class S>
void add_through(PairGradient<D, S> &gradient, const SpinePair<D, S> &p,
                 const BondWeight<D, S> &weight, const S &per_weight)
{
  const S per_part = per_weight * weight.per_part, per_cosine = per_weight * weight.per_cosine;
  for (int k = 0; k < 2 && per_part != 0.0; ++k) {
    const double sign = k == 0 ? 1.0 : -1.0;
    const Vec<D, S> tip_i = (sign * p.A_i) * p.u_i, tip_j = (sign * p.A_j) * p.u_j;
    const S per_i = per_part * weight.opposite.per_foot_on_i[k];  // of u_i.(tip_j - r)
    const S per_j = per_part * weight.opposite.per_foot_on_j[k];  // of u_j.(tip_i + r)
    gradient.r += per_j * p.u_j - per_i * p.u_i;
    gradient.rotation_i += per_i * cross(p.u_i, tip_j - p.r) + per_j * cross(tip_i, p.u_j);
    gradient.rotation_j += per_j * cross(p.u_j, tip_i + p.r) + per_i * cross(tip_j, p.u_i);
  }
  const Torque<D, S> turn = per_cosine * cross(p.u_i, p.u_j);
  gradient.rotation_i += turn;
  gradient.rotation_j -= turn;
}

/// Class of a contact with one bond. Two feet inside the flat parts happen only for skew rods in
/// 3D.
template <int D, class S> ContactKind kind_of(const SpinePair<D, S> &p, const Feet<D, S> &feet)
{
  const bool on_i = abs(feet.s) < p.A_i, on_j = abs(feet.t) < p.A_j;
  if (on_i && on_j) return ContactKind::SIDE_TO_SIDE;
  return on_i || on_j ? ContactKind::TIP_TO_SIDE : ContactKind::TIP_TO_TIP;
}

/// Contact of two spherocylinders in 2D or 3D. With overlaps a of the shortest distance of the
/// spines and b of the far end of the overlap of the spines, E the harmonic law, m = (a + b) / 2:
///     Sides::ONE  V = E(a)                     (Marschall & Teitel 2018, Eqs. 3, 5, 22)
///     Sides::TWO  V = E(a) + D F(a, b, W_b) + W_m (1 - D) (E(m) - E(a))
/// In the second, W_b and W_m are `second_weight` and `mean_weight`, D is of the `Depth` of m, F
/// the `SecondBond`, E(b) where W_b = 1. Overlaps far below (A_min / d)^2 have D = 1, F = W_b E(b):
/// the paper's two bonds (Fig. 6), without the jumps of its rule. Particles that are nearly round
/// for their overlap have D = 0: their two bonds are one contact, which a fading second bond would
/// push aside harder than the contact pushes; E(m) leaves of it the one bond without its kink for
/// parallel rods.
///
/// Force and torques are its exact derivatives. What is left are kinks: where the nearer tip of the
/// far end changes, of relative size of the angle between the rods; where the two bonds change
/// places while W_b is below 1, of size 1 - W_b for small overlaps, over at most A_min / 20; and in
/// 3D, for twisted rods, of full strength. Exactly parallel rods with Sides::ONE sit on such a
/// kink: the lever arm is the middle of the overlap of the spines, which lies between both sides'
/// and is the same for i, j exchanged.
template <int D, class S> class SpherocylinderContact {
 public:
  using Found = Contact<D, S, 2>;

  SpherocylinderContact(const SpherocylinderBody<D, S> &i, const SpherocylinderBody<D, S> &j,
                        const SpherocylinderLaw &contact_law) :
      pair(spine_pair(i, j)), radius_i(i.radius), reach(i.radius + j.radius),
      inverse_reach(S(1.0) / reach), law(contact_law)
  {
  }

  Found evaluate() const
  {
    if (pair.A_i == 0.0 && pair.A_j == 0.0 && law.shortcuts) return discs();
    const auto &values = values_of(pair);
    const auto closest = closest_feet(values);
    if (!touches(closest.distance_sq))
      return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::APART);
    if (is_coincident(closest) || spines_cross(values))
      return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::CROSSING);
    if (law.sides == Sides::TWO) return two_bonds();
    if constexpr (std::is_same_v<S, ValueOf<S>>) {
      return one_bond(closest);
    } else {
      return one_bond(closest_feet(pair));
    }
  }

 private:
  SpinePair<D, S> pair;
  double radius_i, reach;
  S inverse_reach;
  SpherocylinderLaw law;

  /// How a bond enters the energy: `law` times the harmonic law of its own overlap, with
  /// `energy`, `slope` (by the overlap) and at most `bend` of it that do not come from that law.
  struct Share {
    S law, energy, slope, bend;
  };
  static Share whole() { return {1.0, 0.0, 0.0, 0.0}; }

  template <class T> bool touches(const T &distance_sq) const
  {
    return distance_sq < T(reach) * reach;
  }

  template <class T> bool is_coincident(const Feet<D, T> &feet) const
  {
    return feet.distance_sq <= COINCIDENT * reach * COINCIDENT * reach;
  }

  /// What the general path gives for two spines of no length, without the search for feet.
  Found discs() const
  {
    const Feet<D, S> centres{0.0, 0.0, pair.r, norm_sq(pair.r)};
    if (!touches(centres.distance_sq))
      return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::APART);
    if (is_coincident(centres))
      return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::CROSSING);
    Found contact = without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::TOUCHING);
    add_bond(contact, centres, sqrt(centres.distance_sq), whole());
    return contact;
  }

  Found one_bond(const Feet<D, S> &closest) const
  {
    Found contact = without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::TOUCHING);
    const S distance = sqrt(closest.distance_sq);
    if (abs_sine(pair) < PARALLEL_SINE) {
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

  S overlap_at(const S &distance) const { return (reach - distance) * inverse_reach; }

  Found two_bonds() const
  {
    const EndFeet<D, S> ends(pair);
    const Feet<D, S> closest = closest_to_end(pair, ends.nearer());  // never the farther, at a tie
    const Feet<D, S> &far_end = ends.farther();
    const S distance = sqrt(closest.distance_sq), a = overlap_at(distance);
    const double shorter = std::min(pair.A_i, pair.A_j);
    const bool may_be_deep = 0.5 * a * reach * reach > shorter * shorter;
    const bool has_two_ends = touches(far_end.distance_sq);
    if (has_two_ends && are_plainly_whole(values_of(pair), value_of(a), reach)) {
      return two_whole_bonds(closest, far_end);
    }
    if (shorter > 0.0 && (has_two_ends || may_be_deep)) {
      // Of the others, too, many have two whole bonds, or one: that is seen without derivatives.
      const SideToSide<D, ValueOf<S>> side(values_of(pair), values_of(closest), values_of(far_end),
                                           reach);
      if (side.has_two_whole_bonds()) return two_whole_bonds(closest, far_end);
      if (side.has_second() || side.has_mean()) {
        if constexpr (std::is_same_v<S, ValueOf<S>>) {
          return side_to_side(closest, far_end, side);
        } else {
          return side_to_side(closest, far_end, {pair, closest, far_end, reach});
        }
      }
    }
    Found contact = without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::TOUCHING);
    contact.kind = kind_of(pair, closest);
    add_bond(contact, closest, distance, whole());
    return contact;
  }

  Found two_whole_bonds(const Feet<D, S> &closest, const Feet<D, S> &far_end) const
  {
    Found contact = without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::TOUCHING);
    contact.kind = ContactKind::SIDE_TO_SIDE;
    add_bond(contact, closest, sqrt(closest.distance_sq), whole());
    add_bond(contact, far_end, sqrt(far_end.distance_sq), whole());
    return contact;
  }

  Found side_to_side(const Feet<D, S> &closest, const Feet<D, S> &far_end,
                     const SideToSide<D, S> &side) const
  {
    const auto &[overlap, depth, weight, mean_weight] = side;
    const Harmonic &harmonic = law.harmonic;
    const S excess =  // E(m) - E(a)
        -overlap.drop * harmonic.energy_gradient(overlap.a - 0.5 * overlap.drop);
    const S two_bonds = depth.two_bonds, deep = 1.0 - two_bonds, by_mean = mean_weight.value * deep;
    const SecondBond<S> second = side.has_second()
                                     ? SecondBond<S>(harmonic, overlap, weight.value, depth.wide)
                                     : SecondBond<S>();
    const S per_length = second.by_weight * weight.per_length * side.fade_length_per_wide(pair);
    const S through_mean =  // by a and by b alike
        0.5 * (depth.two_bonds_gradient * (second.energy - mean_weight.value * excess) +
               two_bonds * (per_length + second.by_wide) * depth.wide_gradient +
               by_mean * harmonic.energy_gradient(overlap.mean));

    Found contact = without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::TOUCHING);
    contact.kind = ContactKind::SIDE_TO_SIDE;
    add_bond(contact, closest, sqrt(closest.distance_sq),
             {1.0 - by_mean, 0.0, through_mean + two_bonds * second.rest_by_a, 0.5 * by_mean});
    add_bond(contact, far_end, sqrt(far_end.distance_sq),
             {side.has_second() ? two_bonds * weight.value : S(0.0),
              by_mean * harmonic.energy(overlap.mean) + two_bonds * second.rest,
              through_mean + two_bonds * second.rest_by_b, 0.5 * by_mean});

    PairGradient<D, S> fading{};
    add_through(fading, pair, weight, two_bonds * second.by_weight);
    add_through(fading, pair, mean_weight, deep * excess);
    contact.force -= fading.r;
    contact.bond[1].force -= fading.r;
    contact.torque_i -= fading.rotation_i;
    contact.torque_j -= fading.rotation_j;
    return contact;
  }

  /// Adds a bond with the lever arms of `feet` and the overlap of `distance`. Any point on the line
  /// of `feet` gives the same torque; the one reported lies where the surfaces interpenetrate.
  void add_bond(Found &contact, const Feet<D, S> &feet, const S &distance, const Share &share) const
  {
    const S overlap = overlap_at(distance);
    const Vec<D, S> normal = (1.0 / sqrt(feet.distance_sq)) * feet.delta;
    // In dual numbers the law's own slope is left out here: `own_stiffness` stands for it, so that
    // what the derivatives of force and torque hold is the small rest, not its sum with a large
    // number.
    const S slope = share.law * law.harmonic.energy_gradient(constant(overlap)) + share.slope;
    const Vec<D, S> force = (slope * inverse_reach) * normal;
    const S energy = share.law * law.harmonic.energy(overlap) + share.energy;
    Bond<D, S> &bond = contact.bond[contact.n_bonds++];
    bond.normal = normal;
    bond.force = force;
    // Nobody asks for derivatives of these.
    const auto &values = values_of(pair);
    const auto along = values_of(normal);
    const auto depth = radius_i * value_of(distance) * value_of(inverse_reach);
    bond.arm_i = constants_of<S>(value_of(feet.s) * values.u_i - depth * along);
    bond.lever_i = constants_of<S>(value_of(feet.s) * cross(values.u_i, along));
    bond.lever_j = constants_of<S>(-value_of(feet.t) * cross(values.u_j, along));
    bond.distance = distance;
    bond.reach = reach;
    bond.energy = energy;
    const S bend = law.harmonic.energy_hessian(overlap) * inverse_reach * inverse_reach;
    bond.stiffness = (share.law + share.bend) * bend;
    bond.own_stiffness = share.law * bend;
    bond.on_side_i = abs(feet.s) < pair.A_i;
    bond.on_side_j = abs(feet.t) < pair.A_j;
    contact.energy += energy;
    contact.force += force;
    contact.torque_i += feet.s * cross(pair.u_i, force);
    contact.torque_j -= feet.t * cross(pair.u_j, force);
  }
};

template <int D, class S>
Contact<D, S, 2> contact_of(const SpherocylinderBody<D, S> &i, const SpherocylinderBody<D, S> &j,
                            const SpherocylinderLaw &law)
{
  return SpherocylinderContact<D, S>(i, j, law).evaluate();
}

/// With AlongX all that pair styles, Python and sums over pairs need to know of a shape; every
/// shape has one such struct (see ARCHITECTURE.md, how to add a shape).
struct SpherocylinderModel : AlongX<Spherocylinder> {
  using Law = SpherocylinderLaw;

  static constexpr const char *NAME = "spherocylinder";
  static constexpr const char *SHAPE_RULE =
      "a spherocylinder has diameters (2(A+R), 2R, 2R), its long axis the body's x";
  /// What of two particles must not cross.
  static constexpr const char *CORE = "spines";
  /// Bonds of a contact, and whether `sides` changes the law.
  static constexpr int MOST_BONDS = 2;
  static constexpr bool HAS_SIDES = true;
  /// Whether each bond holds a particle like a contact; two bonds side to side are one contact.
  static constexpr bool BONDS_ARE_CONTACTS = false;

  /// Without shortcuts particles whose contacts need no search are searched, too.
  static Law law(double k_e, Sides sides, bool shortcuts = true)
  {
    return {{k_e}, sides, shortcuts};
  }

  /// Whose contacts need no search.
  template <int D> static Shortcut shortcut(const Shape &shape)
  {
    return shape.half_length > 0.0 ? Shortcut::NONE : Shortcut::ROUND;
  }

  template <int D> static SubstrateDrag drag(const Shape &shape)
  {
    return substrate_drag<D>(shape);
  }

  /// Of bond b of a contact.
  template <int D, class S>
  static OnFaces on_faces(const Contact<D, S, MOST_BONDS> &contact, int b, const Body<D, S> &,
                          const Body<D, S> &)
  {
    if (D == 3) return {false, false};
    const bool is_between = contact.kind == ContactKind::SIDE_TO_SIDE;
    return {is_between || contact.bond[b].on_side_i, is_between || contact.bond[b].on_side_j};
  }

  /// Whether the surfaces of i and j are closer than `margin`.
  template <int D> static bool closer_than(double margin, const Body<D> &i, const Body<D> &j)
  {
    const double reach = i.radius + j.radius + margin;
    return spheres_are_closer<D>(margin, i, j) &&
           spine_distance_sq(spine_pair(i, j)) < reach * reach;
  }
};

/// Whether two bodies share more than a point: for Monte Carlo of hard particles.
template <int D>
bool are_overlapping(const SpherocylinderBody<D> &i, const SpherocylinderBody<D> &j)
{
  return SpherocylinderModel::closer_than<D>(0.0, i, j);
}

}  // namespace jamshape
