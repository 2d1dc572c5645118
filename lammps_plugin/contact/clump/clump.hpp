#pragma once

#include "contact/clump/disc_bond.hpp"
#include "contact/clump/form.hpp"
#include "contact/compiled_once.hpp"
#include "contact/contact.hpp"
#include "contact/math/region.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/power_law.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

namespace jamshape {

/// A rigid union of discs (balls in 3D): its form, and the factor of its size.
struct Clump {
  std::shared_ptr<const Discs> discs;
  double scale;
};

/// A clump in a pose. In 2D the y axis follows from the x axis.
template <int D, class S = double> struct ClumpBody {
  static constexpr int AXES = D == 2 ? 1 : D;

  Vec<D, S> centre;
  Vec<D, S> axis[AXES];
  double scale;
  const Discs *discs;

  double outer_radius() const { return scale * discs->outer; }
  double radius(int k) const { return scale * discs->ball[k].radius; }
  int n() const { return static_cast<int>(discs->ball.size()); }
  bool turns() const { return discs->farthest > 0.0; }

  /// Vector from the centre of the body to that of disc k.
  Vec<D, S> arm(int k) const
  {
    const Vec<3> &at = discs->ball[k].centre;
    if constexpr (D == 2) {
      const double x = scale * at[0], y = scale * at[1];
      return {{x * axis[0][0] - y * axis[0][1], x * axis[0][1] + y * axis[0][0]}};
    } else {
      Vec<D, S> sum = S(scale * at[0]) * axis[0];
      for (int m = 1; m < D; ++m) sum += S(scale * at[m]) * axis[m];
      return sum;
    }
  }
};

template <int D, class S> ClumpBody<D, ValueOf<S>> values_of(const ClumpBody<D, S> &body)
{
  ClumpBody<D, ValueOf<S>> values;
  values.centre = values_of(body.centre);
  for (int k = 0; k < body.AXES; ++k) values.axis[k] = values_of(body.axis[k]);
  values.scale = body.scale;
  values.discs = body.discs;
  return values;
}

/// The discs of one body that come closer to another one's bounding circle than a margin, so that
/// the cost of a contact follows those that can touch.
template <int D, class T> struct FacingDiscs {
  int n = 0;
  std::array<int, MOST_DISCS> which;
  std::array<Vec<D, T>, MOST_DISCS> centre;

  FacingDiscs(const ClumpBody<D, T> &of, const ClumpBody<D, T> &other, double margin)
  {
    for (int k = 0; k < of.n(); ++k) {
      centre[n] = of.centre + of.arm(k);
      const T reach = other.outer_radius() + of.radius(k) + margin;
      if (!(norm_sq(centre[n] - other.centre) < reach * reach)) continue;
      which[n++] = k;
    }
  }
};

/// Calls `visit` for each two discs of two bodies whose surfaces are closer than a margin, until
/// it returns false.
template <int D, class T, class Visit>
void each_two_discs(const ClumpBody<D, T> &i, const ClumpBody<D, T> &j, double margin,
                    const Visit &visit)
{
  const T bounding = i.outer_radius() + j.outer_radius() + margin;
  if (!(norm_sq(i.centre - j.centre) < bounding * bounding)) return;
  const FacingDiscs<D, T> of_i(i, j, margin);
  if (of_i.n == 0) return;
  const FacingDiscs<D, T> of_j(j, i, margin);
  for (int a = 0; a < of_i.n; ++a) {
    for (int b = 0; b < of_j.n; ++b) {
      const T reach = i.radius(of_i.which[a]) + j.radius(of_j.which[b]) + margin;
      if (!(norm_sq(of_i.centre[a] - of_j.centre[b]) < reach * reach)) continue;
      if (!visit(of_i.which[a], of_j.which[b])) return;
    }
  }
}

struct ClumpLaw {
  PowerLaw bond;
};

inline constexpr int MOST_BONDS_OF_CLUMPS = 16;

/// Contact of two clumps: V is the sum of the energies of the overlaps 1 - r/d of all pairs of
/// discs, each a bond along the line of centres.
template <int D, class S>
Contact<D, S, MOST_BONDS_OF_CLUMPS> contact_of(const ClumpBody<D, S> &i, const ClumpBody<D, S> &j,
                                               const ClumpLaw &law)
{
  auto contact = without_bonds<D, S, MOST_BONDS_OF_CLUMPS>(ContactStatus::APART);
  const Vec<D, S> r = i.centre - j.centre;
  const auto add = [&](int a, int b) {
    const Vec<D, S> arm_i = i.arm(a), arm_j = j.arm(b);
    add_disc_bond(contact, {arm_i, arm_j, r + arm_i - arm_j, i.radius(a), j.radius(b)}, law.bond);
    return contact.status != ContactStatus::CROSSING;
  };
  if constexpr (std::is_same_v<S, ValueOf<S>>) {
    each_two_discs(i, j, 0.0, add);
  } else {
    each_two_discs(values_of(i), values_of(j), 0.0, add);
  }
  return contact;
}

/// Interface of a shape (see SpherocylinderModel).
struct ClumpModel {
  using Shape = Clump;
  using Law = ClumpLaw;
  using Form = ClumpForm;
  template <int D, class S = double> using Body = ClumpBody<D, S>;
  template <int D> using Start = NoStart;

  static constexpr const char *NAME = "clump";
  static constexpr const char *SHAPE_RULE =
      "a clump has the diameters of the box around its discs, in their proportions";
  static constexpr const char *FORM = "discs";
  static constexpr const char *FORM_RULE =
      "x y z r of each disc (z = 0 in 2D), at most 255, their centre of area at 0 and their "
      "principal axes along x, y and z, as js.Clumps writes them";
  static constexpr const char *CORE = "centres of discs";
  static constexpr int MOST_BONDS = MOST_BONDS_OF_CLUMPS;
  static constexpr bool HAS_SIDES = false;
  /// Whether each bond constrains like a contact of its own, as of dimers.
  static constexpr bool BONDS_ARE_CONTACTS = true;
  static constexpr int OVERLAP_POWER = 1;
  template <int D> static constexpr bool HAS_KINKS = false;

  static Law law(const PowerLaw &bond, Sides, bool /*shortcuts*/ = true) { return {bond}; }

  static std::optional<Shape> shape_from(const Vec<3> &semi_axes, const Form &form)
  {
    const auto &discs = form.discs ? form.discs : one_disc();
    const auto scale = scale_of(semi_axes, discs->half_extents);
    return scale ? std::optional<Shape>({discs, *scale}) : std::nullopt;
  }

  template <int D> static Shortcut shortcut(const Shape &) { return Shortcut::NONE; }
  template <int D> static bool turns(const Shape &shape) { return shape.discs->farthest > 0.0; }

  template <int D> static SubstrateDrag drag(const Shape &shape)
  {
    return scaled<D>(shape.discs->drag, shape.scale);
  }

  template <int D> static double outer_radius(const Shape &shape)
  {
    return shape.scale * shape.discs->outer;
  }
  template <int D> static double inner_radius(const Shape &shape)
  {
    return shape.scale * shape.discs->smallest;
  }
  template <int D> static double rotation_length(const Shape &shape)
  {
    return shape.scale * shape.discs->farthest;
  }
  template <int D> static double turning_radius(const Shape &shape)
  {
    return rotation_length<D>(shape);
  }

  /// The axis on which all centres lie.
  static std::optional<int> symmetry_axis(const Shape &shape)
  {
    const Discs &discs = *shape.discs;
    if (discs.farthest == 0.0) return std::nullopt;
    for (int axis = 0; axis < 3; ++axis) {
      const auto is_off = [&](const Ball &one) {
        return norm(one.centre) - std::abs(one.centre[axis]) > COINCIDENT * discs.farthest;
      };
      if (std::none_of(discs.ball.begin(), discs.ball.end(), is_off)) return axis;
    }
    return std::nullopt;
  }

  template <int D> static std::optional<int> director(const Shape &shape)
  {
    return long_axis_of<D>(shape.discs->drag.moment);
  }

  template <int D, class S = double> static Body<D, S> body(const Shape &shape)
  {
    Body<D, S> body{};
    for (int k = 0; k < body.AXES; ++k) body.axis[k][k] = 1.0;
    body.scale = shape.scale;
    body.discs = shape.discs.get();
    return body;
  }

  template <int D, class S> static void turn_to(Body<D, S> &body, const QuaternionOf<S> &q)
  {
    body.axis[0] = long_axis<D, S>(q);
    for (int k = 1; k < body.AXES; ++k) {
      if constexpr (D == 3) body.axis[k] = body_axis(q, k);
    }
  }

  /// Discs have no faces.
  template <int D, class S>
  static OnFaces on_faces(const Contact<D, S, MOST_BONDS> &, int, const Body<D, S> &,
                          const Body<D, S> &)
  {
    return {false, false};
  }

  /// Whether the gap between the surfaces of i and j is smaller than `margin`.
  template <int D> static bool closer_than(double margin, const Body<D> &i, const Body<D> &j)
  {
    bool is_closer = false;
    each_two_discs(i, j, margin, [&](int, int) {
      is_closer = true;
      return false;
    });
    return is_closer;
  }

  template <int D> struct Pose {
    Vec<D> centre;
    Vec<D> axis[Body<D>::AXES];
  };
  template <int D> static Pose<D> pose(const Body<D> &body)
  {
    Pose<D> pose{body.centre, {}};
    for (int k = 0; k < body.AXES; ++k) pose.axis[k] = body.axis[k];
    return pose;
  }

  /// Upper bound of the squared displacement of any point: |dx| + |x| (sum |du_k|^2)^(1/2), where
  /// in 2D both axes turn alike. A disc turns about its own centre without moving its surface.
  template <int D>
  static double motion_sq(const Vec<D> &shift, const Body<D> &now, const Pose<D> &then)
  {
    double turned = 0.0;
    for (int k = 0; k < now.AXES; ++k) turned += norm_sq(now.axis[k] - then.axis[k]);
    const double moved = norm(shift) + now.scale * now.discs->farthest * std::sqrt(turned);
    return moved * moved;
  }

 private:
  static const std::shared_ptr<const Discs> &one_disc()
  {
    static const auto disc =
        std::make_shared<const Discs>(2, std::vector<Ball>{{{}, 1.0}}, union_of_discs({{{}, 1.0}}));
    return disc;
  }
};

/// Whether two bodies share more than a point: for Monte Carlo of hard particles.
template <int D> bool are_overlapping(const ClumpBody<D> &i, const ClumpBody<D> &j)
{
  return ClumpModel::closer_than<D>(0.0, i, j);
}

JAMSHAPE_CONTACTS(extern, ClumpModel)

}  // namespace jamshape
