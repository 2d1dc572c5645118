#pragma once

#include "contact/along_x.hpp"
#include "contact/clump/disc_bond.hpp"
#include "contact/compiled_once.hpp"
#include "contact/contact.hpp"
#include "contact/math/vec.hpp"
#include "contact/power_law.hpp"

#include <algorithm>
#include <cmath>

namespace jamshape {

/// Two equal discs (balls in 3D) of radius R with centres at +-A on the body's x, joined rigidly;
/// they overlap if A < R.
struct Dimer {
  double half_length;
  double radius;
};

/// Area (volume in 3D) and moments of the union: twice the portion of one disc on its side of the
/// middle. With x measured from that disc's centre, it ends at x = -h, h = min(A, R).
template <int D> SubstrateDrag substrate_drag(const Dimer &shape);

template <> inline SubstrateDrag substrate_drag<2>(const Dimer &shape)
{
  const double A = shape.half_length, R = shape.radius;
  const double c = std::min(A / R, 1.0), s = std::sqrt((1.0 - c) * (1.0 + c)), cs = c * s;
  const double angle = M_PI - std::acos(c), by_angle = cs * (2.0 * c * c - 1.0);
  const double area = R * R * (angle + cs);
  const double x = 2.0 / 3.0 * R * R * R * s * s * s;  // integrals of x, x^2, y^2 over it
  const double xx = 0.25 * R * R * R * R * (angle + by_angle);
  const double yy = R * R * R * R * (0.25 * angle + cs / 3.0 - by_angle / 12.0);
  const double about_y = A * A + (2.0 * A * x + xx) / area;
  return {2.0 * area, {{yy / area, about_y, A * A + (2.0 * A * x + xx + yy) / area}}};
}

template <> inline SubstrateDrag substrate_drag<3>(const Dimer &shape)
{
  const double A = shape.half_length, R = shape.radius, h = std::min(A, R);
  const double R2 = R * R, R3 = R2 * R, R5 = R3 * R2, h2 = h * h, h3 = h2 * h, h5 = h3 * h2;
  const double volume = M_PI * (2.0 / 3.0 * R3 + R2 * h - h3 / 3.0);
  const double x = 0.25 * M_PI * (R2 - h2) * (R2 - h2);  // integrals of x, x^2 and y^2 + z^2
  const double xx = M_PI * (2.0 / 15.0 * R5 + R2 * h3 / 3.0 - 0.2 * h5);
  const double across =
      0.5 * M_PI * (8.0 / 15.0 * R5 + R2 * R2 * h - 2.0 / 3.0 * R2 * h3 + 0.2 * h5);
  const double about_y = A * A + (2.0 * A * x + xx + 0.5 * across) / volume;
  return {2.0 * volume, {{across / volume, about_y, about_y}}};
}

template <int D, class S = double> using DimerBody = BodyAlongX<Dimer, D, S>;

/// Vector from the centre of a dimer to that of its first or second disc.
template <int D, class S> Vec<D, S> to_disc(const DimerBody<D, S> &body, int which)
{
  return S(which == 0 ? body.half_length : -body.half_length) * body.axis;
}

struct DimerLaw {
  PowerLaw bond;
};

/// Contact of two dimers: V is the sum of the energies of the overlaps 1 - r/d of up to four
/// pairs of discs, each a bond along the line of centres.
template <int D, class S>
Contact<D, S, 4> contact_of(const DimerBody<D, S> &i, const DimerBody<D, S> &j, const DimerLaw &law)
{
  Contact<D, S, 4> contact = without_bonds<D, S, 4>(ContactStatus::APART);
  const Vec<D, S> r = i.centre - j.centre;
  for (int a = 0; a < 2; ++a) {
    const Vec<D, S> arm_i = to_disc(i, a);
    for (int b = 0; b < 2; ++b) {
      const Vec<D, S> arm_j = to_disc(j, b);
      add_disc_bond(contact, {arm_i, arm_j, r + arm_i - arm_j, i.radius, j.radius}, law.bond);
    }
  }
  return contact;
}

/// Interface of a shape (see SpherocylinderModel).
struct DimerModel : AlongX<Dimer> {
  using Law = DimerLaw;

  static constexpr const char *NAME = "dimer";
  static constexpr const char *SHAPE_RULE =
      "a dimer has diameters (2(A+R), 2R, 2R), its two discs on the body's x";
  static constexpr const char *CORE = "centres";
  static constexpr int MOST_BONDS = 4;
  static constexpr bool HAS_SIDES = false;
  template <int D> static constexpr bool HAS_KINKS = false;
  /// Each pair of discs constrains like a contact of its own, whatever other bonds the dimers
  /// share.
  static constexpr bool BONDS_ARE_CONTACTS = true;

  static Law law(const PowerLaw &bond, Sides, bool /*shortcuts*/ = true) { return {bond}; }

  template <int D> static Shortcut shortcut(const Shape &) { return Shortcut::NONE; }

  template <int D> static SubstrateDrag drag(const Shape &shape)
  {
    return substrate_drag<D>(shape);
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
    if (!spheres_are_closer<D>(margin, i, j)) return false;
    const Vec<D> r = i.centre - j.centre;
    const double reach = i.radius + j.radius + margin;
    for (int a = 0; a < 2; ++a) {
      for (int b = 0; b < 2; ++b) {
        if (norm_sq(r + to_disc(i, a) - to_disc(j, b)) < reach * reach) return true;
      }
    }
    return false;
  }
};

/// Whether two bodies share more than a point: for Monte Carlo of hard particles.
template <int D> bool are_overlapping(const DimerBody<D> &i, const DimerBody<D> &j)
{
  return DimerModel::closer_than<D>(0.0, i, j);
}

JAMSHAPE_CONTACTS(extern, DimerModel)

}  // namespace jamshape
