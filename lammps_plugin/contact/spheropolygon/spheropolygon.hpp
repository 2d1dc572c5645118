#pragma once

#include "contact/compiled_once.hpp"
#include "contact/contact.hpp"
#include "contact/instruction_set.hpp"
#include "contact/math/region.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/packs.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"
#include "contact/spheropolygon/form.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <type_traits>

namespace jamshape {

/// A rounded polygon: its form, and the factor of its size.
struct Spheropolygon {
  std::shared_ptr<const RoundedPolygon> polygon;
  double scale;
};

/// A rounded polygon in a pose; it lives in the plane, and has no body in space.
template <int D, class S = double> struct SpheropolygonBody {
  Vec<D, S> centre;
  Vec<D, S> axis;
  double scale;
  const RoundedPolygon *polygon;

  double radius() const { return scale * polygon->rounding; }
  double core_radius() const { return scale * polygon->farthest; }
  int n() const { return static_cast<int>(polygon->side.size()); }

  /// A vector in the body's coordinates, in space.
  Vec<D, S> turned(const Vec<2> &v) const
  {
    Vec<D, S> there{};
    there[0] = v[0] * axis[0] - v[1] * axis[1];
    there[1] = v[0] * axis[1] + v[1] * axis[0];
    return there;
  }
  Vec<D, S> middle(int side) const { return turned(scale * polygon->side[side].middle); }
  Vec<D, S> along(int side) const { return turned(polygon->side[side].along); }
  double half_length(int side) const { return scale * polygon->side[side].half_length; }
};

template <int D, class S>
SpheropolygonBody<D, ValueOf<S>> values_of(const SpheropolygonBody<D, S> &body)
{
  return {values_of(body.centre), values_of(body.axis), body.scale, body.polygon};
}

/// The spines of two sides.
template <int D, class S>
SpinePair<D, S> sides_of(const SpheropolygonBody<D, S> &i, int a, const SpheropolygonBody<D, S> &j,
                         int b)
{
  return {i.centre - j.centre + i.middle(a) - j.middle(b), i.along(a), i.half_length(a), j.along(b),
          j.half_length(b)};
}

/// The sides of one body that come closer to the other core's bounding circle than `reach`.
template <int D, class T> struct FacingSides {
  struct Spine {
    int side;
    Vec<D, T> middle, along;  // from the centre of the body; unit
    T half_length;
  };
  int n = 0;
  std::array<Spine, MOST_CORNERS> spine;

  FacingSides(const SpheropolygonBody<D, T> &of, const SpheropolygonBody<D, T> &other, T reach)
  {
    // In the coordinates and the unit of the body.
    const Vec<D, T> away = other.centre - of.centre;
    const T unit = T(1.0) / of.scale;
    const T x = unit * (of.axis[0] * away[0] + of.axis[1] * away[1]);
    const T y = unit * (of.axis[0] * away[1] - of.axis[1] * away[0]);
    reach = unit * (reach + other.core_radius());
    for (int k = 0; k < of.n(); ++k) {
      const auto &side = of.polygon->side[k];
      const T from_x = x - side.middle[0], from_y = y - side.middle[1];
      const T at = limited(from_x * side.along[0] + from_y * side.along[1], T(side.half_length));
      const T off_x = from_x - at * side.along[0], off_y = from_y - at * side.along[1];
      if (off_x * off_x + off_y * off_y < reach * reach)
        spine[n++] = {k, of.middle(k), of.along(k), of.half_length(k)};
    }
  }
};

/// Whether the centre of one body lies in the core of the other.
template <int D, class T>
bool holds_centre(const SpheropolygonBody<D, T> &of, const SpheropolygonBody<D, T> &other)
{
  const Vec<D, T> at = other.centre - of.centre;
  for (int k = 0; k < of.n(); ++k) {
    const Vec<D, T> along = of.along(k), from = at - of.middle(k);
    if (!(along[0] * from[1] - along[1] * from[0] > 0.0)) return false;
  }
  return of.n() > 1;
}

/// Calls `visit` with each two sides that face each other and may be closer than `reach`, and their
/// spines, until it returns false. Returns false if the centre of one body lies in the other's
/// core.
template <int D, class T, class Visit>
bool each_two_sides(const SpheropolygonBody<D, T> &i, const SpheropolygonBody<D, T> &j, T reach,
                    const Visit &visit)
{
  const T bounding = i.core_radius() + j.core_radius() + reach;
  const Vec<D, T> r = i.centre - j.centre;
  if (!(norm_sq(r) < bounding * bounding)) return true;
  const FacingSides<D, T> of_i(i, j, reach);
  const FacingSides<D, T> of_j(j, i, reach);
  for (int m = 0; m < of_i.n; ++m) {
    const auto &one = of_i.spine[m];
    for (int n = 0; n < of_j.n; ++n) {
      const auto &two = of_j.spine[n];
      const Vec<D, T> apart = r + one.middle - two.middle;
      const T near = reach + one.half_length + two.half_length;
      if (!(norm_sq(apart) < near * near)) continue;
      const SpinePair<D, T> spines{apart, one.along, static_cast<Plain<T>>(one.half_length),
                                   two.along, static_cast<Plain<T>>(two.half_length)};
      if (!visit(one.side, two.side, spines)) return true;
    }
  }
  return !holds_centre(i, j) && !holds_centre(j, i);
}

/// A contact of two sides, of arms about their middles, as one about the centres of the bodies,
/// given the vectors from there to the middles.
template <int D, class S>
Contact<D, S, 2> about_centres(Contact<D, S, 2> contact, const Vec<D, S> &to_i,
                               const Vec<D, S> &to_j)
{
  contact.torque_i += cross(to_i, contact.force);
  contact.torque_j -= cross(to_j, contact.force);
  for (int b = 0; b < contact.n_bonds; ++b) {
    Bond<D, S> &bond = contact.bond[b];
    bond.arm_i += to_i;
    bond.lever_i += cross(to_i, bond.normal);
    bond.lever_j -= cross(to_j, bond.normal);
  }
  return contact;
}

/// Names a contact with one bond by where this lies. Two sides that share a corner have equal
/// energies there, and rounding decides between them; only one of them may face the other body.
template <int D, class S> void name_corner(Contact<D, S, 2> &contact)
{
  if (contact.n_bonds != 1 || contact.kind != ContactKind::SIDE_TO_SIDE) return;
  const bool is_on_side = contact.bond[0].on_side_i || contact.bond[0].on_side_j;
  contact.kind = is_on_side ? ContactKind::TIP_TO_SIDE : ContactKind::TIP_TO_TIP;
}

/// The contact of the two sides with the largest energy, about their middles.
template <int D, class T> struct LargestOfSides {
  Contact<D, T, 2> contact = without_bonds<D, T, 2>(ContactStatus::APART);
  int side_i = 0, side_j = 0;

  LargestOfSides(const SpheropolygonBody<D, T> &i, const SpheropolygonBody<D, T> &j,
                 const SpherocylinderLaw &law)
  {
    const double R_i = i.radius(), R_j = j.radius();
    const auto compare = [&](int a, int b, const SpinePair<D, T> &spines) {
      const Contact<D, T, 2> found = SpherocylinderContact<D, T>(spines, R_i, R_j, law).evaluate();
      if (found.status == ContactStatus::CROSSING) {
        contact = found;
        return false;
      }
      if (!(found.energy > contact.energy)) return true;
      contact = found;
      side_i = a;
      side_j = b;
      return true;
    };
    const bool is_clear = each_two_sides<D, T>(i, j, R_i + R_j, compare);
    if (!is_clear) contact = without_bonds<D, T, 2>(ContactStatus::CROSSING);
  }
};

/// A smooth piece of the energy of two polygons: that of two sides, with the far end of their bonds
/// at a tip. As a number it takes the place of the tip in the law.
struct PieceOfSides {
  int side_i, side_j, tip;

  static constexpr int TIPS = 8, SIDES = 1 << 8;
  static PieceOfSides of(int number)
  {
    const int sides = number / TIPS;
    return {sides / SIDES, sides % SIDES, number % TIPS - 1};
  }
  int number() const { return (side_i * SIDES + side_j) * TIPS + tip + 1; }
};

/// Contact of two sides by the law of rods, about the centres of the polygons.
template <int D, class S>
Contact<D, S, 2> contact_of_sides(const SpheropolygonBody<D, S> &i,
                                  const SpheropolygonBody<D, S> &j, const SpherocylinderLaw &law,
                                  const PieceOfSides &piece)
{
  const SpherocylinderContact<D, S> there(sides_of(i, piece.side_i, j, piece.side_j), i.radius(),
                                          j.radius(),
                                          SpherocylinderModel::on_piece(law, piece.tip));
  return about_centres(there.evaluate(), i.middle(piece.side_i), j.middle(piece.side_j));
}

/// Contact of two rounded polygons: that of the two of their sides with the largest energy, each
/// two by the law of rods (SpherocylinderContact), so that polygons of two corners are rods. Sides
/// that share a corner have the same energy there, of the corner's distance; flat contacts have two
/// bonds. Overlapping cores have no law.
template <int D, class S>
Contact<D, S, 2> contact_of(const SpheropolygonBody<D, S> &i, const SpheropolygonBody<D, S> &j,
                            const SpherocylinderLaw &law)
{
  using T = ValueOf<S>;
  if (law.tip != NO_TIP) return contact_of_sides(i, j, law, PieceOfSides::of(law.tip));
  const LargestOfSides<D, T> best(values_of(i), values_of(j), law);
  if (best.contact.status != ContactStatus::TOUCHING)
    return without_bonds<D, S, 2>(best.contact.status);
  Contact<D, S, 2> found;
  if constexpr (std::is_same_v<S, T>) {
    found = about_centres(best.contact, i.middle(best.side_i), j.middle(best.side_j));
  } else {
    found = contact_of_sides(i, j, law, {best.side_i, best.side_j, NO_TIP});
  }
  if (law.sides == Sides::TWO && i.n() + j.n() > 2) name_corner(found);
  return found;
}

/// Interface of a shape (see SpherocylinderModel).
struct SpheropolygonModel {
  using Shape = Spheropolygon;
  using Law = SpherocylinderLaw;
  using Form = SpheropolygonForm;
  template <int D, class S = double> using Body = SpheropolygonBody<D, S>;
  template <int D> using Start = NoStart;

  static constexpr const char *NAME = "spheropolygon";
  static constexpr const char *SHAPE_RULE =
      "a spheropolygon, in the plane, has the diameters of the box around it, in their proportions";
  static constexpr const char *FORM = "polygon";
  static constexpr const char *FORM_RULE =
      "a rounding radius and x y of up to 255 corners, convex and counter-clockwise, the centre of "
      "area of the body at 0 and its principal axes along x and y, as js.Spheropolygons writes "
      "them, in dimension 2";
  static constexpr const char *CORE = "cores";
  static constexpr int MOST_BONDS = 2;
  static constexpr bool HAS_SIDES = true;
  static constexpr bool BONDS_ARE_CONTACTS = false;
  static constexpr int OVERLAP_POWER = 1;

  static Law law(const PowerLaw &bond, Sides sides, bool shortcuts = true)
  {
    return {bond, sides, shortcuts};
  }

  /// One piece for each tip of each two sides, as for rods.
  template <int D> static constexpr bool HAS_KINKS = D == 2;
  template <int D> static int piece(const Body<D> &i, const Body<D> &j, const Law &law)
  {
    const LargestOfSides<D, double> best(i, j, law);
    if (best.contact.status != ContactStatus::TOUCHING) return NO_TIP;
    const auto spines = sides_of(i, best.side_i, j, best.side_j);
    const SpherocylinderContact<D, double> there(spines, i.radius(), j.radius(), law);
    return PieceOfSides{best.side_i, best.side_j, there.tip()}.number();
  }
  static Law on_piece(const Law &law, int piece)
  {
    return SpherocylinderModel::on_piece(law, piece);
  }

  static std::optional<Shape> shape_from(const Vec<3> &semi_axes, const Form &form)
  {
    const auto &polygon = form.polygon ? form.polygon : disc();
    const auto scale = scale_of(semi_axes, polygon->half_extents);
    return scale ? std::optional<Shape>({polygon, *scale}) : std::nullopt;
  }

  template <int D> static Shortcut shortcut(const Shape &shape)
  {
    return turns<D>(shape) ? Shortcut::NONE : Shortcut::ROUND;
  }
  template <int D> static bool turns(const Shape &shape) { return shape.polygon->farthest > 0.0; }

  template <int D> static SubstrateDrag drag(const Shape &shape)
  {
    return scaled<2>(shape.polygon->drag, shape.scale);
  }

  template <int D> static double outer_radius(const Shape &shape)
  {
    return shape.scale * (shape.polygon->farthest + shape.polygon->rounding);
  }
  template <int D> static double inner_radius(const Shape &shape)
  {
    return 0.5 * shape.scale * shape.polygon->width;
  }
  /// Distance from the surface to the core.
  static double rim(const Shape &shape) { return shape.scale * shape.polygon->rounding; }

  template <int D> static double rotation_length(const Shape &shape)
  {
    return shape.scale * shape.polygon->farthest;
  }
  template <int D> static double turning_radius(const Shape &shape)
  {
    return rotation_length<D>(shape);
  }

  /// The long axis of a rod; no other body in the plane has one.
  static std::optional<int> symmetry_axis(const Shape &shape)
  {
    return shape.polygon->corner.size() == 2 ? director<2>(shape) : std::nullopt;
  }

  template <int D> static std::optional<int> director(const Shape &shape)
  {
    return long_axis_of<2>(shape.polygon->drag.moment);
  }

  template <int D, class S = double> static Body<D, S> body(const Shape &shape)
  {
    Vec<D, S> along_x{};
    along_x[0] = 1.0;
    return {{}, along_x, shape.scale, shape.polygon.get()};
  }

  template <int D, class S> static void turn_to(Body<D, S> &body, const QuaternionOf<S> &q)
  {
    body.axis = long_axis<D, S>(q);
  }

  /// Whether a bond lies on a straight side, over which a particle cannot roll.
  template <int D, class S>
  static OnFaces on_faces(const Contact<D, S, MOST_BONDS> &contact, int b, const Body<D, S> &,
                          const Body<D, S> &)
  {
    const bool is_between = contact.kind == ContactKind::SIDE_TO_SIDE;
    return {is_between || contact.bond[b].on_side_i, is_between || contact.bond[b].on_side_j};
  }

  /// Whether the gap between the surfaces of i and j is smaller than `margin`.
  template <int D> static bool closer_than(double margin, const Body<D> &i, const Body<D> &j)
  {
    const double reach = i.radius() + j.radius() + margin;
    bool is_closer = false;
    const bool is_clear =
        each_two_sides<D, double>(i, j, reach, [&](int, int, const SpinePair<D> &spines) {
          is_closer = spine_distance_sq(spines) < reach * reach;
          return !is_closer;
        });
    return is_closer || !is_clear;
  }

  template <int D> struct Pose {
    Vec<D> centre, axis;
  };
  template <int D> static Pose<D> pose(const Body<D> &body) { return {body.centre, body.axis}; }

  /// Upper bound of the squared displacement of any point of the core: |dx| + |x| |du|.
  template <int D>
  static double motion_sq(const Vec<D> &shift, const Body<D> &now, const Pose<D> &then)
  {
    const double moved = norm(shift) + now.core_radius() * norm(now.axis - then.axis);
    return moved * moved;
  }

 private:
  static const std::shared_ptr<const RoundedPolygon> &disc()
  {
    static const auto one = std::make_shared<const RoundedPolygon>(1.0, std::vector<Vec<2>>{{}});
    return one;
  }
};

/// Compiled in packs.cpp for each instruction set: the sides in packs of rods.
template <InstructionSet SET>
void find_polygon_contacts(const SpheropolygonBody<2> *bodies, const SpherocylinderLaw &law,
                           ContactBlock<2> &block);

template <> struct PacksOf<SpheropolygonModel, 2> {
  static constexpr bool EXIST = true, CHOOSE = false;
  static bool take(const Spheropolygon &, const Spheropolygon &) { return true; }

  static FindContacts<SpheropolygonModel, 2> *of(InstructionSet set)
  {
    return compiled_for(set, [](auto one) { return &find_polygon_contacts<decltype(one)::value>; });
  }
};

/// Whether two bodies share more than a point: for Monte Carlo of hard particles.
template <int D> bool are_overlapping(const SpheropolygonBody<D> &i, const SpheropolygonBody<D> &j)
{
  return SpheropolygonModel::closer_than<D>(0.0, i, j);
}

JAMSHAPE_CONTACTS(extern, SpheropolygonModel)

}  // namespace jamshape
