#pragma once

#include "contact/contact.hpp"
#include "contact/harmonic.hpp"
#include "contact/rotation.hpp"
#include "contact/segment_segment.hpp"
#include "contact/smooth_step.hpp"
#include "contact/vec.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace jamshape {

/// A segment of length 2A (the spine) along the body's x, thickened by R. A = 0 is a disc (a
/// sphere).
struct Spherocylinder {
  double half_length;
  double radius;

  double bounding_radius() const { return half_length + radius; }
};

/// From the semi-axes that LAMMPS stores, (A + R, R, R); nothing when they are of another shape.
inline std::optional<Spherocylinder> spherocylinder_from(const Vec<3> &semi_axes)
{
  const bool is_one = semi_axes[1] == semi_axes[2] && semi_axes[0] >= semi_axes[1] &&
                      semi_axes[1] > 0.0 && std::isfinite(semi_axes[0]);
  if (!is_one) return std::nullopt;
  return Spherocylinder{semi_axes[0] - semi_axes[1], semi_axes[1]};
}

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

/// Shape and pose of one particle, as the pair loops read it.
template <int D> struct SpherocylinderBody {
  Vec<D> centre;
  Vec<D> axis;
  double half_length;
  double radius;
};

/// Whether nearly parallel rods touch at one bond or at two (Marschall & Teitel 2018: one in the
/// dynamics, Fig. 1d; two for minima and the dynamical matrix, Fig. 6).
enum class Sides { ONE = 1, TWO = 2 };

struct SpherocylinderLaw {
  Harmonic harmonic;
  Sides sides;
};

/// Below this |sin| of the angle between them two spines are parallel: their one bond sits in the
/// middle of the overlap of the spines (Marschall & Teitel 2018, Sec. II, taken modulo pi).
inline constexpr double PARALLEL_SINE = 1e-8;

/// The second bond fades in over this fraction of the shorter half length of spine overlap, and
/// over this range of |cos| of the angle; it fades out while its overlap (as a length) grows from
/// A_min^2 / d to FADE_DEPTH times that.
inline constexpr double FADE_LENGTH = 0.05;
inline constexpr double FADE_DEPTH = 16.0;
inline constexpr double FADE_COSINE_START = 0.5;
inline constexpr double FADE_COSINE_RANGE = 0.35;

/// Feet closer than this times R_i + R_j are one point: no direction is left to push along.
inline constexpr double COINCIDENT = 1e-14;

template <int D>
SpinePair<D> spine_pair(const SpherocylinderBody<D> &i, const SpherocylinderBody<D> &j)
{
  return {i.centre - j.centre, i.axis, i.half_length, j.axis, j.half_length};
}

/// Weight of the second bond with its derivatives with respect to r and to rotations of i and j,
/// the bond's own distance apart.
template <int D> struct BondWeight {
  double value;
  double per_distance;
  Vec<D> per_r;
  Torque<D> per_rotation_i;
  Torque<D> per_rotation_j;
};

/// w = S(l / (c A_min)) S((|u_i.u_j| - 0.5) / 0.35) (1 - S(ln y / ln 16)), l the spread of the two
/// ends, y the overlap of the farther one over A_min^2 / d. It is 1 for side-to-side contacts and
/// goes to 0 smoothly where the second bond ends: at spines that just begin to overlap and at large
/// angles, where the rule of Marschall & Teitel (Fig. 6) jumps, and for nearly round particles that
/// overlap by so much that their two bonds are one (the fading would push them apart harder than
/// the contact).
template <int D>
BondWeight<D> second_bond_weight(const SpinePair<D> &p, const EndFeet<D> &ends, double overlap,
                                 double reach)
{
  const double shorter = std::min(p.A_i, p.A_j);
  if (shorter == 0.0) return {};
  const double cosine = dot(p.u_i, p.u_j);
  const double x_length = ends.spread() / (FADE_LENGTH * shorter);
  const double x_cosine = (std::abs(cosine) - FADE_COSINE_START) / FADE_COSINE_RANGE;
  const double depth = overlap * reach * reach / (shorter * shorter);
  const double x_depth = depth > 1.0 ? std::log(depth) / std::log(FADE_DEPTH) : 0.0;
  const double by_length = smooth_step(x_length), by_cosine = smooth_step(x_cosine);
  const double by_depth = 1.0 - smooth_step(x_depth);

  BondWeight<D> weight{};
  weight.value = by_length * by_cosine * by_depth;
  if (weight.value == 0.0 || weight.value == 1.0) return weight;

  weight.per_distance = by_length * by_cosine * smooth_step_gradient(x_depth) /
                        (std::log(FADE_DEPTH) * overlap * reach);
  const double per_spread =
      by_cosine * by_depth * smooth_step_gradient(x_length) / (FADE_LENGTH * shorter);
  const double sign_s = std::copysign(0.5 * per_spread, ends.plus.s - ends.minus.s);
  const double sign_t = std::copysign(0.5 * per_spread, ends.plus.t - ends.minus.t);
  const auto add_foot = [&](const Feet<D> &feet, double per_s, double per_t) {
    if (std::abs(feet.s) < p.A_i) {  // s = u_i.(t u_j - r) slides; at a tip it is fixed
      weight.per_r -= per_s * p.u_i;
      weight.per_rotation_i += per_s * cross(p.u_i, feet.t * p.u_j - p.r);
      weight.per_rotation_j += (per_s * feet.t) * cross(p.u_j, p.u_i);
    } else if (std::abs(feet.t) < p.A_j) {  // t = u_j.(r + s u_i)
      weight.per_r += per_t * p.u_j;
      weight.per_rotation_j += per_t * cross(p.u_j, p.r + feet.s * p.u_i);
      weight.per_rotation_i += (per_t * feet.s) * cross(p.u_i, p.u_j);
    }
  };
  add_foot(ends.plus, sign_s, sign_t);
  add_foot(ends.minus, -sign_s, -sign_t);

  const double per_cosine = std::copysign(
      by_length * by_depth * smooth_step_gradient(x_cosine) / FADE_COSINE_RANGE, cosine);
  const Torque<D> turn = per_cosine * cross(p.u_i, p.u_j);
  weight.per_rotation_i += turn;
  weight.per_rotation_j -= turn;
  return weight;
}

/// Class of a contact with one bond. Two feet inside the flat parts happen only for skew rods in
/// 3D.
template <int D> ContactKind kind_of(const SpinePair<D> &p, const Feet<D> &feet)
{
  const bool on_i = std::abs(feet.s) < p.A_i, on_j = std::abs(feet.t) < p.A_j;
  if (on_i && on_j) return ContactKind::SIDE_TO_SIDE;
  return on_i || on_j ? ContactKind::TIP_TO_SIDE : ContactKind::TIP_TO_TIP;
}

/// Contact of two spherocylinders in 2D or 3D: V = k_e/2 (1 - r/d)^2 of the shortest distance of
/// the spines (Marschall & Teitel 2018, Eqs. 3, 5, 22), and with Sides::TWO a second bond at the
/// far end of the overlap of the spines (Fig. 6), faded in by `second_bond_weight`:
///     V = V_a + w V_b.
/// Force and torques are its exact derivatives. What is left are kinks: where the nearer tip
/// changes, of relative size of the angle between the rods; where the two bonds change places while
/// w < 1, of size 1 - w; and in 3D, for twisted rods, of full strength. Exactly parallel rods with
/// Sides::ONE sit on such a kink: the lever arm is the middle of the overlap of the spines, which
/// lies between both sides' and is the same for i, j exchanged.
template <int D> class SpherocylinderContact {
 public:
  SpherocylinderContact(const SpherocylinderBody<D> &i, const SpherocylinderBody<D> &j,
                        const SpherocylinderLaw &contact_law) :
      pair(spine_pair(i, j)), radius_i(i.radius), reach(i.radius + j.radius),
      inverse_reach(1.0 / reach), law(contact_law)
  {
  }

  Contact<D> evaluate() const
  {
    if (pair.A_i == 0.0 && pair.A_j == 0.0) return discs();
    const Feet<D> closest = closest_feet(pair);
    if (!touches(closest.distance_sq)) return empty(ContactStatus::APART);
    if (is_coincident(closest) || spines_cross(pair)) return empty(ContactStatus::CROSSING);
    return law.sides == Sides::ONE ? one_bond(closest) : two_bonds();
  }

 private:
  SpinePair<D> pair;
  double radius_i, reach, inverse_reach;
  SpherocylinderLaw law;

  /// The share of a bond in the energy, and the energy that it loses as it fades with distance.
  struct Share {
    double weight, fading;
  };
  static constexpr Share WHOLE{1.0, 0.0};

  bool touches(double distance_sq) const { return distance_sq < reach * reach; }

  bool is_coincident(const Feet<D> &feet) const
  {
    return feet.distance_sq <= COINCIDENT * reach * COINCIDENT * reach;
  }

  /// No bond yet; the bonds themselves stay unset, most pairs of a list being apart.
  static Contact<D> empty(ContactStatus status)
  {
    Contact<D> contact;
    contact.status = status;
    contact.kind = ContactKind::TIP_TO_TIP;
    contact.n_bonds = 0;
    contact.energy = 0.0;
    contact.force = {};
    contact.torque_i = contact.torque_j = {};
    return contact;
  }

  /// What the general path gives for two spines of no length, without the search for feet.
  Contact<D> discs() const
  {
    const Feet<D> centres{0.0, 0.0, pair.r, norm_sq(pair.r)};
    if (!touches(centres.distance_sq)) return empty(ContactStatus::APART);
    if (is_coincident(centres)) return empty(ContactStatus::CROSSING);
    Contact<D> contact = empty(ContactStatus::TOUCHING);
    add_bond(contact, centres, std::sqrt(centres.distance_sq), WHOLE);
    return contact;
  }

  Contact<D> one_bond(const Feet<D> &closest) const
  {
    Contact<D> contact = empty(ContactStatus::TOUCHING);
    const double distance = std::sqrt(closest.distance_sq);
    if (abs_sine(pair) < PARALLEL_SINE) {
      const EndFeet<D> ends(pair);
      if (ends.spread() > 0.0) {
        contact.kind = ContactKind::SIDE_TO_SIDE;
        // The energy stays that of the shortest distance, so that it does not jump at
        // PARALLEL_SINE.
        add_bond(contact, ends.middle(pair), distance, WHOLE);
        return contact;
      }
    }
    contact.kind = kind_of(pair, closest);
    add_bond(contact, closest, distance, WHOLE);
    return contact;
  }

  Contact<D> two_bonds() const
  {
    const EndFeet<D> ends(pair);
    const Feet<D> closest = closest_from_end(pair, ends.nearer().t);  // never the farther, at a tie
    Contact<D> contact = empty(ContactStatus::TOUCHING);
    contact.kind = kind_of(pair, closest);
    add_bond(contact, closest, std::sqrt(closest.distance_sq), WHOLE);
    const Feet<D> &far_end = ends.farther();
    if (!touches(far_end.distance_sq)) return contact;
    const double distance = std::sqrt(far_end.distance_sq);
    const double overlap = (reach - distance) * inverse_reach;
    const BondWeight<D> weight = second_bond_weight(pair, ends, overlap, reach);
    if (weight.value == 0.0) return contact;

    contact.kind = ContactKind::SIDE_TO_SIDE;
    const double V_b = law.harmonic.energy(overlap);
    add_bond(contact, far_end, distance, {weight.value, V_b * weight.per_distance});
    const Vec<D> fade_force = -V_b * weight.per_r;
    contact.force += fade_force;
    contact.bond[1].force += fade_force;
    contact.torque_i -= V_b * weight.per_rotation_i;
    contact.torque_j -= V_b * weight.per_rotation_j;
    return contact;
  }

  /// Adds a bond with the lever arms of `feet` and the overlap of `distance`. Any point on the line
  /// of `feet` gives the same torque; the one reported lies where the surfaces interpenetrate.
  void add_bond(Contact<D> &contact, const Feet<D> &feet, double distance, const Share &share) const
  {
    const double overlap = (reach - distance) * inverse_reach;
    const Vec<D> normal = (1.0 / std::sqrt(feet.distance_sq)) * feet.delta;
    const double push =
        share.weight * law.harmonic.energy_gradient(overlap) * inverse_reach - share.fading;
    const Vec<D> force = push * normal;
    const double energy = share.weight * law.harmonic.energy(overlap);
    Bond<D> &bond = contact.bond[contact.n_bonds++];
    bond.normal = normal;
    bond.force = force;
    bond.arm_i = feet.s * pair.u_i - (radius_i * distance * inverse_reach) * normal;
    bond.distance = distance;
    bond.reach = reach;
    bond.energy = energy;
    bond.stiffness =
        share.weight * law.harmonic.energy_hessian(overlap) * inverse_reach * inverse_reach;
    bond.on_side_i = std::abs(feet.s) < pair.A_i;
    bond.on_side_j = std::abs(feet.t) < pair.A_j;
    contact.energy += energy;
    contact.force += force;
    contact.torque_i += feet.s * cross(pair.u_i, force);
    contact.torque_j -= feet.t * cross(pair.u_j, force);
  }
};

template <int D>
Contact<D> contact_of(const SpherocylinderBody<D> &i, const SpherocylinderBody<D> &j,
                      const SpherocylinderLaw &law)
{
  return SpherocylinderContact<D>(i, j, law).evaluate();
}

/// What a pair style, its neighbour list and the drag need to know of a shape; every shape has one
/// such struct (see ARCHITECTURE.md, how to add a shape).
struct SpherocylinderModel {
  using Shape = Spherocylinder;
  using Law = SpherocylinderLaw;
  using Options = Sides;
  template <int D> using Body = SpherocylinderBody<D>;

  static constexpr const char *SHAPE_RULE =
      "a spherocylinder has diameters (2(A+R), 2R, 2R), its long axis the body's x";

  static Law law(Options sides, double k_e) { return {{k_e}, sides}; }

  static std::optional<Shape> shape_from(const Vec<3> &semi_axes)
  {
    return spherocylinder_from(semi_axes);
  }

  /// Particles that no contact can turn need no orientation.
  static bool turns(const Shape &shape) { return shape.half_length > 0.0; }

  template <int D> static SubstrateDrag drag(const Shape &shape)
  {
    return substrate_drag<D>(shape);
  }

  template <int D> static Body<D> body(const Shape &shape)
  {
    Vec<D> along_x{};
    along_x[0] = 1.0;
    return {{}, along_x, shape.half_length, shape.radius};
  }

  template <int D> static void turn_to(Body<D> &body, const Quaternion &q)
  {
    body.axis = long_axis<D>(q);
  }

  /// Whether the surfaces of i and j are closer than `margin`.
  template <int D> static bool closer_than(double margin, const Body<D> &i, const Body<D> &j)
  {
    const SpinePair<D> pair = spine_pair(i, j);
    const double reach = i.radius + j.radius + margin;
    const double bounding = reach + i.half_length + j.half_length;
    return norm_sq(pair.r) < bounding * bounding && spine_distance_sq(pair) < reach * reach;
  }

  /// Upper bound of the squared distance that any point of the spine moved: |dx + s du| over |s| <=
  /// A, by (a + b)^2 <= 2 a^2 + 2 b^2.
  template <int D>
  static double motion_sq(const Vec<D> &shift, const Body<D> &now, const Vec<D> &axis)
  {
    const double turned = now.half_length * now.half_length * norm_sq(now.axis - axis);
    return turned == 0.0 ? norm_sq(shift) : 2.0 * (norm_sq(shift) + turned);
  }
};

}  // namespace jamshape
