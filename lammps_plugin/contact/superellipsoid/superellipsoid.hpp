#pragma once

#include "contact/compiled_once.hpp"
#include "contact/contact.hpp"
#include "contact/instruction_set.hpp"
#include "contact/math/vec.hpp"
#include "contact/packs.hpp"
#include "contact/power_law.hpp"
#include "contact/superellipsoid/errors.hpp"
#include "contact/superellipsoid/shape.hpp"
#include "contact/superellipsoid/tangency.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

namespace jamshape {

/// Law of the overlap 1 - eta^2, eta < 1 the scale at which the two bodies, scaled about their
/// centres, touch (Perram & Wertheim 1985): harmonic in Yuan et al. 2019, Eq. 2, U = epsilon/2 (1 -
/// eta^2)^2.
struct SuperellipsoidLaw {
  PowerLaw bond;
  bool shortcuts;  // false: also spheres and ellipsoids by the search for all exponents
};

/// Above this relative error bar of the scale the contact could not be computed and is reported as
/// UNCONVERGED, not dropped. No such case is known.
inline constexpr double USELESS = 1e-6;

template <int D, class S>
Tangency<D, S> tangency_of_spheres(const Vec<D, S> &r, const Plain<S> &R_i, const Plain<S> &R_j)
{
  const Plain<S> d = R_i + R_j;
  return {norm(r) / d, r, S(R_i / d) * r, S(R_j / d) * r};
}

/// Contribution of a tangency at r to a contact. In dual numbers the slope of the law is held
/// constant: `own_stiffness` accounts for it (see ContactDerivatives).
template <int D, class S> struct TangencyLoad {
  S x, overlap, energy;
  Vec<D, S> gradient, force, arm_i, arm_j;
  Torque<D, S> torque_i, torque_j;

  TangencyLoad(const Tangency<D, S> &at, const Vec<D, S> &r, const PowerLawOf<Plain<S>> &law) :
      x(at.scale * at.scale), overlap((1.0 - at.scale) * (1.0 + at.scale)),
      energy(law.energy(overlap)), gradient((2.0 * x / dot(r, at.normal)) * at.normal),
      force(law.energy_gradient(constant(overlap)) * gradient), arm_i(-at.point_i),
      arm_j(at.point_j), torque_i(cross(arm_i, force)), torque_j(-cross(arm_j, force))
  {
  }
};

/// Contact of two superellipsoids in 2D or 3D. With x = eta^2, n the common normal where the scaled
/// bodies touch, grad_r x = 2 x n / (r.n): the printed force (Yuan et al. 2019, Eq. 3) lacks one
/// eta. By the envelope theorem the torques are those of this force at the point of tangency of the
/// **scaled** bodies. Normal and levers of the one bond are the gradient of x over |grad_r x|, that
/// of a length; its reach is 1 / |grad_r x|, so that the stiffness is E'' / reach^2 as for
/// other shapes; its distance is reach times x, so that 1 - distance / reach is the overlap. For
/// two spheres of contact distance d the distance is r / 2, and the reach d / 2 where they touch.
///
/// Where two faces are in contact, the scale hardly depends on the point of tangency, and where two
/// tips are, hardly on the normal: a small gap between the bounds of the scale does not bound the
/// errors of these (see errors.hpp).
template <int D, class S> class SuperellipsoidContact {
 public:
  using Found = Contact<D, S, 1>;
  using T = ValueOf<S>;
  using Body = SuperellipsoidBody<D, S>;

  SuperellipsoidContact(const Body &body_i, const Body &body_j, const SuperellipsoidLaw &of) :
      i(body_i), j(body_j), r(body_i.centre - body_j.centre), law(of.bond), shortcuts(of.shortcuts)
  {
  }

  /// Starts from the normal `last` and replaces it by the one found, also if the bodies are apart.
  Found evaluate_from(Vec<D, T> &last) { return evaluate_with(&last); }

  Found evaluate() const { return evaluate_with(nullptr); }

 private:
  const Body &i, &j;
  Vec<D, S> r;
  PowerLaw law;
  bool shortcuts;

  static constexpr bool IS_PLAIN = sizeof(S) == sizeof(T);  // no derivatives

  Found evaluate_with(Vec<D, T> *last) const
  {
    const double reach = i.bounding_radius + j.bounding_radius;
    const T distance_sq = value_of(norm_sq(r));
    if (!(distance_sq < T(reach) * reach))
      return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::APART);
    if (distance_sq <= COINCIDENT * reach * COINCIDENT * reach) {
      return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::CROSSING);
    }
    if (shortcuts && is_round(i) && is_round(j))
      // A closed form bounds itself.
      return touching(tangency_of_spheres(r, i.semi_axes[0], j.semi_axes[0]), T(0));
    const FoundTangency<D, T> found = find_tangency(last);
    if (last != nullptr) *last = found.at.normal;
    Found contact = contact_at(found);
    if constexpr (std::is_same_v<T, double>) contact.needs_digits = needs_digits(found);
    return contact;
  }

  Found contact_at(const FoundTangency<D, T> &found) const
  {
    if (found.is_apart) return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::APART);
    if (!(found.gap < T(USELESS)))
      return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::UNCONVERGED);
    if (!(found.at.scale < 1)) return without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::APART);
    return touching(in_scalar(found.at), found.gap);
  }

  FoundTangency<D, T> find_tangency(const Vec<D, T> *last) const
  {
    if constexpr (IS_PLAIN) {
      return tangency_of(i, j, TangencyWish<D, T>{r, true, last, shortcuts});
    } else {
      const SuperellipsoidBody<D, T> plain_i = plain<T>(i), plain_j = plain<T>(j);
      return tangency_of(plain_i, plain_j, TangencyWish<D, T>{plain<T>(r), true, last, shortcuts});
    }
  }

  Tangency<D, S> in_scalar(const Tangency<D, T> &found) const
  {
    if constexpr (IS_PLAIN) {
      return found;
    } else {
      return TangencyIn<D, S>(i, j, r).from(found);
    }
  }

  Found touching(const Tangency<D, S> &at, const T &gap) const
  {
    const TangencyLoad<D, S> load(at, r, law);
    const S steepness = norm(load.gradient), reach = T(1) / steepness;
    Found contact = without_bonds<D, S, Found::MOST_BONDS>(ContactStatus::TOUCHING);
    contact.n_bonds = 1;
    contact.gap = static_cast<double>(gap);
    contact.energy = load.energy;
    contact.force = load.force;
    contact.torque_i = load.torque_i;
    contact.torque_j = load.torque_j;
    Bond<D, S> &bond = contact.bond[0];
    bond.normal = reach * load.gradient;
    bond.force = contact.force;
    bond.arm_i = load.arm_i;
    bond.lever_i = cross(load.arm_i, bond.normal);
    bond.lever_j = -cross(load.arm_j, bond.normal);
    bond.distance = reach * load.x;
    bond.reach = reach;
    bond.energy = contact.energy;
    bond.stiffness = bond.own_stiffness = law.energy_hessian(load.overlap) * steepness * steepness;
    bond.coupling = 0.0;
    bond.on_side_i = bond.on_side_j = false;
    return contact;
  }
};

template <int D, class S>
Contact<D, S, 1> contact_of(const SuperellipsoidBody<D, S> &i, const SuperellipsoidBody<D, S> &j,
                            const SuperellipsoidLaw &law)
{
  return SuperellipsoidContact<D, S>(i, j, law).evaluate();
}

/// The same, starting from the normal that this pair had at the previous step (any vector at
/// first), which is replaced by the present one: one or two iterations instead of ten.
template <int D, class S>
Contact<D, S, 1> contact_of(const SuperellipsoidBody<D, S> &i, const SuperellipsoidBody<D, S> &j,
                            const SuperellipsoidLaw &law, Vec<D, ValueOf<S>> &last_normal)
{
  return SuperellipsoidContact<D, S>(i, j, law).evaluate_from(last_normal);
}

/// Interface of a shape (see SpherocylinderModel).
struct SuperellipsoidModel {
  using Shape = Superellipsoid;
  using Law = SuperellipsoidLaw;
  template <int D, class S = double> using Body = SuperellipsoidBody<D, S>;
  template <int D> using Start = Vec<D>;  // a normal

  static constexpr const char *NAME = "superellipsoid";
  static constexpr const char *SHAPE_RULE =
      "a superellipsoid has positive diameters (2a, 2b, 2c) and an exponent p above 0.5, or two "
      "exponents n1 n2 above 1";
  static constexpr const char *CORE = "centres";
  static constexpr int MOST_BONDS = 1;
  static constexpr bool HAS_SIDES = false;
  template <int D> static constexpr bool HAS_KINKS = false;
  static constexpr bool BONDS_ARE_CONTACTS = false;
  static constexpr int OVERLAP_POWER = 2;

  static Law law(const PowerLaw &bond, Sides, bool shortcuts = true) { return {bond, shortcuts}; }

  using Form = SuperellipsoidForm;
  static constexpr const char *FORM = "p";
  static constexpr const char *FORM_RULE =
      "a finite number above 0.5, or two numbers n1 n2 above 1, those of LAMMPS, where n1 = n2 = "
      "2p "
      "is the same body: particles of other exponents are not convex";

  static std::optional<Shape> shape_from(const Vec<3> &semi_axes, const Form &form)
  {
    return superellipsoid_from(semi_axes, form);
  }

  template <int D> static Shortcut shortcut(const Shape &shape)
  {
    if (shape.is_round<D>()) return Shortcut::ROUND;
    return shape.is_ellipsoid() ? Shortcut::ELLIPSOIDS : Shortcut::NONE;
  }

  template <int D> static bool turns(const Shape &shape) { return !shape.is_round<D>(); }

  template <int D> static SubstrateDrag drag(const Shape &shape)
  {
    return substrate_drag<D>(shape);
  }

  template <int D> static double outer_radius(const Shape &shape)
  {
    return shape.bounding_radius<D>();
  }
  template <int D> static double inner_radius(const Shape &shape)
  {
    return *std::min_element(shape.semi_axes.c, shape.semi_axes.c + D);
  }
  template <int D> static double rotation_length(const Shape &shape)
  {
    return turns<D>(shape) ? shape.semi_axes[0] : 0.0;
  }
  template <int D> static double turning_radius(const Shape &shape)
  {
    return turns<D>(shape) ? outer_radius<D>(shape) : 0.0;
  }
  static std::optional<int> symmetry_axis(const Shape &shape) { return shape.symmetry_axis(); }
  template <int D> static std::optional<int> director(const Shape &shape)
  {
    return shape.director<D>();
  }

  template <int D, class S = double> static Body<D, S> body(const Shape &shape)
  {
    Body<D, S> body{};
    for (int k = 0; k < D; ++k) {
      body.axis[k][k] = 1.0;
      body.semi_axes[k] = shape.semi_axes[k];
    }
    body.p = shape.p;
    body.p_across = shape.p_across;
    body.bounding_radius = shape.bounding_radius<D>();
    return body;
  }

  template <int D, class S> static void turn_to(Body<D, S> &body, const QuaternionOf<S> &q)
  {
    if constexpr (D == 2) {
      body.axis[0] = long_axis<2, S>(q);
      body.axis[1] = {{-body.axis[0][1], body.axis[0][0]}};
    } else {
      for (int k = 0; k < D; ++k) body.axis[k] = body_axis(q, k);
    }
  }

  template <int D, class S>
  static OnFaces on_faces(const Contact<D, S, MOST_BONDS> &contact, int b, const Body<D, S> &i,
                          const Body<D, S> &j)
  {
    const Vec<D, S> &arm_i = contact.bond[b].arm_i;
    return {is_flat_at(i, arm_i), is_flat_at(j, arm_i + (i.centre - j.centre))};
  }

  /// Whether the surfaces of i and j may be closer than `margin`: false if the gap between two
  /// parallel planes excludes it. The planes tried are normal to the line of centres, to the
  /// bodies' axes and, nearly, the tangent plane of two ellipsoids.
  template <int D> static bool closer_than(double margin, const Body<D> &i, const Body<D> &j)
  {
    const Vec<D> r = i.centre - j.centre;
    const double distance_sq = norm_sq(r),
                 bounding = i.bounding_radius + j.bounding_radius + margin;
    if (distance_sq >= bounding * bounding) return false;
    if (distance_sq == 0.0 || (is_round(i) && is_round(j))) return true;
    using Norm = PowerNorm<D, double>;
    const auto h_i = Norm::support(i), h_j = Norm::support(j);
    const auto divides = [&](const Vec<D> &n) {
      return std::abs(dot(r, n)) >= h_i.value(n) + h_j.value(n) + margin * norm(n);
    };
    if (divides(r)) return false;
    for (int k = 0; k < D; ++k) {
      if (divides(i.axis[k]) || divides(j.axis[k])) return false;
    }
    return !divides(detail::ByNormalOfEllipsoids<D, double>(i, j, r).start());
  }

  template <int D> struct Pose {
    Vec<D> centre;
    Vec<D> axis[D];
  };
  template <int D> static Pose<D> pose(const Body<D> &body)
  {
    Pose<D> pose{body.centre, {}};
    for (int k = 0; k < D; ++k) pose.axis[k] = body.axis[k];
    return pose;
  }

  /// Upper bound of the squared displacement of any point of the body, |dx + sum x_k du_k| over
  /// |x_k| <= a_k.
  template <int D>
  static double motion_sq(const Vec<D> &shift, const Body<D> &now, const Pose<D> &then)
  {
    double turned = 0.0;
    for (int k = 0; k < D; ++k) turned += now.semi_axes[k] * norm(now.axis[k] - then.axis[k]);
    const double moved = norm(shift) + turned;
    return moved * moved;
  }
};

/// Compiled in packs.cpp for each instruction set. Bodies with two exponents do without.
template <InstructionSet SET, int D>
FindContacts<SuperellipsoidModel, D> find_superellipsoid_contacts;

template <int D> struct PacksOf<SuperellipsoidModel, D> {
  static constexpr bool EXIST = true, CHOOSE = false;
  static bool take(const Superellipsoid &shape, const Superellipsoid &first)
  {
    return shape.p == first.p && shape.p_across == shape.p;
  }

  static FindContacts<SuperellipsoidModel, D> *of(InstructionSet set)
  {
    return compiled_for(
        set, [](auto one) { return &find_superellipsoid_contacts<decltype(one)::value, D>; });
  }
};

/// Whether two bodies share more than a point, with the least work that decides it: for Monte Carlo
/// of hard particles.
template <int D>
bool are_overlapping(const SuperellipsoidBody<D> &i, const SuperellipsoidBody<D> &j)
{
  const Vec<D> r = i.centre - j.centre;
  const double distance_sq = norm_sq(r), bounding = i.bounding_radius + j.bounding_radius;
  if (distance_sq >= bounding * bounding) return false;
  if (distance_sq <= COINCIDENT * bounding * COINCIDENT * bounding) return true;
  const auto found = TangencySearch<D, double>(i, j, {r, true, nullptr}).is_overlap();
  if (found.has_value()) return *found;
  using Long = long double;
  const TangencyWish<D, Long> wish{plain<Long>(i.centre) - plain<Long>(j.centre), false, nullptr};
  return tangency_of(plain<Long>(i), plain<Long>(j), wish).at.scale < 1;
}

/// Searches behind contacts and for overlaps, compiled like JAMSHAPE_CONTACTS.
#define JAMSHAPE_SEARCHES(KEYWORD, D)                                                              \
  KEYWORD template Contact<D, double, 1> contact_of(const SuperellipsoidBody<D> &,                 \
                                                    const SuperellipsoidBody<D> &,                 \
                                                    const SuperellipsoidLaw &, Vec<D> &);          \
  KEYWORD template Contact<D, Dual<PAIR_VARIABLES<D>>, 1> contact_of(                              \
      const SuperellipsoidBody<D, Dual<PAIR_VARIABLES<D>>> &,                                      \
      const SuperellipsoidBody<D, Dual<PAIR_VARIABLES<D>>> &, const SuperellipsoidLaw &,           \
      Vec<D> &);                                                                                   \
  KEYWORD template FoundTangency<D, double> tangency_of(const SuperellipsoidBody<D> &,             \
                                                        const SuperellipsoidBody<D> &,             \
                                                        const TangencyWish<D, double> &);          \
  KEYWORD template FoundTangency<D, long double> tangency_of(                                      \
      const SuperellipsoidBody<D, long double> &, const SuperellipsoidBody<D, long double> &,      \
      const TangencyWish<D, long double> &);                                                       \
  KEYWORD template bool are_overlapping(const SuperellipsoidBody<D> &,                             \
                                        const SuperellipsoidBody<D> &);

JAMSHAPE_CONTACTS(extern, SuperellipsoidModel)
JAMSHAPE_SEARCHES(extern, 2)
JAMSHAPE_SEARCHES(extern, 3)

}  // namespace jamshape
