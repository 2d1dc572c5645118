#pragma once

#include "contact/math/vec.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace jamshape {

/// Two spines (segments) in relative coordinates: r = centre of i - centre of j; u unit vectors,
/// A half lengths. Only differences of positions enter, so no digits are lost far from the origin.
template <int D, class S = double> struct SpinePair {
  Vec<D, S> r;
  Vec<D, S> u_i;
  Plain<S> A_i;
  Vec<D, S> u_j;
  Plain<S> A_j;
};

/// The pair without derivatives, or itself if it has none: searches and other decisions depend on
/// values alone.
template <int D, class S> decltype(auto) values_of(const SpinePair<D, S> &p)
{
  using Value = ValueOf<S>;
  if constexpr (std::is_same_v<S, Value>) {
    return (p);
  } else {
    return SpinePair<D, Value>{values_of(p.r), values_of(p.u_i), p.A_i, values_of(p.u_j), p.A_j};
  }
}

/// A point on each spine, s along u_i from the centre of i and t along u_j from the centre of j,
/// and the vector from the point on j to the point on i.
template <int D, class S = double> struct Feet {
  S s, t;
  Vec<D, S> delta;
  S distance_sq;
};

template <int D, class S> Feet<D, ValueOf<S>> values_of(const Feet<D, S> &f)
{
  return {value_of(f.s), value_of(f.t), values_of(f.delta), value_of(f.distance_sq)};
}

template <int D, class S> Feet<D, S> feet_at(const SpinePair<D, S> &p, const S &s, const S &t)
{
  const Vec<D, S> delta = p.r + s * p.u_i - t * p.u_j;
  return {s, t, delta, norm_sq(delta)};
}

/// `a` where a condition holds, else `b`.
template <int D, class S>
Feet<D, S> chosen(const Truth<S> &where, const Feet<D, S> &a, const Feet<D, S> &b)
{
  return {select(where, a.s, b.s), select(where, a.t, b.t), chosen(where, a.delta, b.delta),
          select(where, a.distance_sq, b.distance_sq)};
}

/// `x` clamped to [-bound, bound], in two instructions, which std::clamp does not compile to.
template <class S> S limited(const S &x, const Plain<S> &bound)
{
  return least(S(bound), most(S(-bound), x));
}

/// Foot on spine j of the point s of spine i, and vice versa.
template <int D, class S> S foot_on_j(const SpinePair<D, S> &p, const S &s)
{
  return limited(dot(p.u_j, p.r + s * p.u_i), p.A_j);
}

template <int D, class S> S foot_on_i(const SpinePair<D, S> &p, const S &t)
{
  return limited(dot(p.u_i, t * p.u_j - p.r), p.A_i);
}

/// The four tips with their feet on the other spine: tips +, - of i, then +, - of j. Kept as
/// numbers in arrays, since most pairs need only `nearest`.
template <int D, class S> struct TipFeet {
  S s[4], t[4], distance_sq[4];

  explicit TipFeet(const SpinePair<D, S> &p)
  {
    for (int k = 0; k < 2; ++k) {
      const double sign = k == 0 ? 1.0 : -1.0;
      s[k] = S(sign * p.A_i);
      t[k] = foot_on_j(p, s[k]);
      t[2 + k] = S(sign * p.A_j);
      s[2 + k] = foot_on_i(p, t[2 + k]);
    }
    for (int k = 0; k < 4; ++k) distance_sq[k] = norm_sq(p.r + s[k] * p.u_i - t[k] * p.u_j);
  }

  /// A tip and its foot, for the same pair in any scalar.
  template <class T> Feet<D, T> feet(const SpinePair<D, T> &p, int k) const
  {
    if constexpr (std::is_same_v<T, S>) {
      return feet_at(p, s[k], t[k]);
    } else if (k < 2) {
      return feet_at(p, T(s[k]), foot_on_j(p, T(s[k])));
    } else {
      return feet_at(p, foot_on_i(p, T(t[k])), T(t[k]));
    }
  }

  /// Index of the smallest distance; without branches, which would be unpredictable.
  int nearest() const
  {
    const int of_i = distance_sq[1] < distance_sq[0], of_j = 2 + (distance_sq[3] < distance_sq[2]);
    return distance_sq[of_j] < distance_sq[of_i] ? of_j : of_i;
  }

  /// The t of the nearest tip.
  S t_of_nearest() const
  {
    if constexpr (std::is_same_v<Truth<S>, bool>) {
      return t[nearest()];
    } else {
      const Truth<S> of_i = distance_sq[1] < distance_sq[0], of_j = distance_sq[3] < distance_sq[2];
      const Truth<S> on_j = select(of_j, distance_sq[3], distance_sq[2]) <
                            select(of_i, distance_sq[1], distance_sq[0]);
      return select(on_j, select(of_j, t[3], t[2]), select(of_i, t[1], t[0]));
    }
  }
};

/// No number of a tip.
inline constexpr int NO_TIP = -1;

/// Whether feet `a` are closer than `b`, each a tip and its foot on the other spine. If they share
/// a tip, the one whose other foot lies inside the spine is closer: it is the nearest point to that
/// tip. Rounded distances cannot distinguish feet within 1e-8 of each other, which would leave
/// normal and lever arms with half of their digits.
template <int D, class S>
Truth<S> is_closer(const SpinePair<D, S> &p, const Feet<D, S> &a, const Feet<D, S> &b)
{
  const Truth<S> a_on_i = abs(a.s) < p.A_i, b_on_i = abs(b.s) < p.A_i;
  const Truth<S> a_on_j = abs(a.t) < p.A_j, b_on_j = abs(b.t) < p.A_j;
  const Truth<S> tip_of_i = (a.s == b.s) & (a_on_j ^ b_on_j);
  const Truth<S> tip_of_j = (a.t == b.t) & (a_on_i ^ b_on_i);
  return select(tip_of_i, a_on_j, select(tip_of_j, a_on_i, a.distance_sq < b.distance_sq));
}

/// The closest approach at either end of the pair: at end e = +, - the shorter of (tip e of i to
/// spine j) and (tip of j at the same end to spine i), the spines aligned by the sign of u_i.u_j.
/// For nearly parallel rods these are the two ends of the overlap of the spines.
template <int D, class S> struct EndFeet {
  Feet<D, S> plus, minus;

  /// A tip (numbered as in `TipFeet`) may be given as the one of the farther end.
  explicit EndFeet(const SpinePair<D, S> &p, int far_tip = NO_TIP)
  {
    if constexpr (std::is_same_v<Truth<S>, bool>) {
      find_by_tip(p, far_tip);
    } else {
      find_in_lanes(p);
    }
  }

  Feet<D, S> nearer() const { return chosen(minus_is_nearer, minus, plus); }
  Feet<D, S> farther() const { return chosen(minus_is_nearer, plus, minus); }
  int tip_of_farther() const { return minus_is_nearer ? plus_tip : minus_tip; }

  /// Whether the two ends are different points.
  bool are_apart() const { return plus.s != minus.s || plus.t != minus.t; }

  /// The middle between the two ends, on both spines.
  Feet<D, S> middle(const SpinePair<D, S> &p) const
  {
    return feet_at(p, 0.5 * (plus.s + minus.s), 0.5 * (plus.t + minus.t));
  }

 private:
  Truth<S> minus_is_nearer;
  int plus_tip = NO_TIP, minus_tip = NO_TIP;

  void find_by_tip(const SpinePair<D, S> &p, int far_tip)
  {
    const auto &values = values_of(p);
    const TipFeet<D, ValueOf<S>> tips(values);
    const int j_plus = dot(values.u_i, values.u_j) < 0.0 ? 3 : 2, j_minus = 5 - j_plus;
    struct AtTip {
      int tip;
      Feet<D, ValueOf<S>> feet;
    };
    const auto closer = [&](int a, int b) {
      const AtTip at_a{a, tips.feet(values, a)}, at_b{b, tips.feet(values, b)};
      return is_closer(values, at_b.feet, at_a.feet) ? at_b : at_a;
    };
    const bool plus_is_far = far_tip == 0 || far_tip == j_plus;
    const bool minus_is_far = far_tip != NO_TIP && !plus_is_far;
    const int i_at_plus = plus_is_far ? far_tip : 0, i_at_minus = minus_is_far ? far_tip : 1;
    const AtTip at_plus = closer(i_at_plus, plus_is_far ? far_tip : j_plus);
    const AtTip at_minus = closer(i_at_minus, minus_is_far ? far_tip : j_minus);
    minus_is_nearer =
        far_tip == NO_TIP ? is_closer(values, at_minus.feet, at_plus.feet) : plus_is_far;
    plus_tip = at_plus.tip;
    minus_tip = at_minus.tip;
    if constexpr (std::is_same_v<S, ValueOf<S>>) {
      plus = at_plus.feet;
      minus = at_minus.feet;
    } else {
      plus = tips.feet(p, at_plus.tip);
      minus = tips.feet(p, at_minus.tip);
    }
  }

  /// The same for all lanes of a pack.
  void find_in_lanes(const SpinePair<D, S> &p)
  {
    const TipFeet<D, S> tips(p);
    const Truth<S> opposed = dot(p.u_i, p.u_j) < S(0.0);
    const auto closer = [&](const Feet<D, S> &of_i, const Feet<D, S> &of_j) {
      return chosen(is_closer(p, of_j, of_i), of_j, of_i);
    };
    const Feet<D, S> first = tips.feet(p, 2), second = tips.feet(p, 3);
    plus = closer(tips.feet(p, 0), chosen(opposed, second, first));
    minus = closer(tips.feet(p, 1), chosen(opposed, first, second));
    minus_is_nearer = is_closer(p, minus, plus);
  }
};

/// The closest points near the point t of spine j: each is the foot of the other.
template <int D, class S> Feet<D, S> each_others_feet(const SpinePair<D, S> &p, const S &t)
{
  const S s = foot_on_i(p, t);
  return feet_at(p, s, foot_on_j(p, s));
}

/// The closest points of two spines, given the point t on j of their nearer end. In 2D, spines that
/// do not cross are closest there; skew spines in 3D may be closest inside both.
template <class S> Feet<2, S> closest_from_end(const SpinePair<2, S> &p, const S &t)
{
  return each_others_feet(p, t);
}

/// The closest points of two skew spines if they lie inside both; else `at_end()`.
template <class S, class AtEnd>
Feet<3, S> closest_inside(const SpinePair<3, S> &p, const AtEnd &at_end)
{
  // The component of u_i across u_j, from the difference of the axes, so that nearly parallel
  // spines lose no digits.
  const Vec<3, S> turn = p.u_i - copysign(S(1.0), dot(p.u_i, p.u_j)) * p.u_j;
  const Vec<3, S> across = turn - dot(turn, p.u_j) * p.u_j;
  const S sin_sq = norm_sq(across);
  const S s = -dot(p.r, across) / sin_sq;
  const S t = dot(p.u_j, p.r + s * p.u_i);
  // Feet inside both spines are the minimum, since the distance is convex; comparing it with that
  // at the ends would place the feet of nearly parallel spines by rounding. For parallel ones s is
  // infinite or NaN.
  const Truth<S> inside = (abs(s) < p.A_i) & (abs(t) < p.A_j) & !(sin_sq == S(0.0));
  if (!any(inside)) return at_end();
  const Feet<3, S> found = feet_at(p, foot_on_i(p, t), t);
  return all(inside) ? found : chosen(inside, found, at_end());
}

template <class S> Feet<3, S> closest_from_end(const SpinePair<3, S> &p, const S &t)
{
  return closest_inside(p, [&] { return each_others_feet(p, t); });
}

template <class S> Feet<2, S> closest_to_end(const SpinePair<2, S> &, const Feet<2, S> &end)
{
  return end;
}
template <class S> Feet<3, S> closest_to_end(const SpinePair<3, S> &p, const Feet<3, S> &end)
{
  return closest_inside(p, [&] { return end; });
}

/// Below this squared sine of the angle, the intersection of the lines through two spines does not
/// determine where the spines are closest.
inline constexpr double NO_INTERSECTION_SINE_SQ = 1e-8;

template <int D, class S> Feet<D, S> closest_by_tips(const SpinePair<D, S> &p)
{
  const TipFeet<D, S> tips(p);
  return closest_from_end(p, tips.t_of_nearest());
}

/// The closest points of two spines. In 2D they are at the tip towards the intersection of their
/// lines, which saves the search over four tips; crossing spines, a state to detect
/// (`spines_cross`), end up at the intersection.
template <int D, class S> Feet<D, S> closest_feet(const SpinePair<D, S> &p)
{
  if constexpr (D == 2) {
    const S sine = cross(p.u_i, p.u_j)[0];
    const Truth<S> meet = sine * sine > S(NO_INTERSECTION_SINE_SQ);
    if (!any(meet)) return closest_by_tips(p);
    const S towards = limited(cross(p.u_j, p.r)[0] / sine, p.A_i);
    const Feet<D, S> found = each_others_feet(p, foot_on_j(p, towards));
    return all(meet) ? found : chosen(meet, found, closest_by_tips(p));
  } else {
    return closest_by_tips(p);
  }
}

/// Whether the far ends of the facing portions of two spines may be closer than `reach`, given the
/// feet where they are closest. Spines in 2D diverge from there by the sine of their angle.
template <class S>
Truth<S> far_ends_may_touch(const SpinePair<2, S> &p, const Feet<2, S> &closest,
                            const Plain<S> &reach)
{
  const S sine = cross(p.u_i, p.u_j)[0], cosine = dot(p.u_i, p.u_j);
  // If they lie on one side of each other's tip, no portions face each other.
  const Truth<S> beside = (p.A_i + p.A_j * abs(cosine) <= abs(dot(p.u_i, p.r))) |
                          (p.A_j + p.A_i * abs(cosine) <= abs(dot(p.u_j, p.r)));
  if (all(beside)) return !beside;
  // They converge towards the intersection of their lines.
  const S of_i =
      p.A_i + copysign(closest.s, closest.s * (cross(p.u_j, p.r)[0] - closest.s * sine) * sine);
  const S of_j =
      p.A_j + copysign(closest.t, closest.t * (cross(p.u_i, p.r)[0] - closest.t * sine) * sine);
  const Truth<S> nearly_parallel = sine * sine < S(NO_INTERSECTION_SINE_SQ);
  return (nearly_parallel | (least(of_i, of_j) * abs(sine) < S(reach))) & !beside;
}
template <class S>
Truth<S> far_ends_may_touch(const SpinePair<3, S> &, const Feet<3, S> &closest, const Plain<S> &)
{
  return closest.distance_sq == closest.distance_sq;
}

/// |sin| of the angle between the spines, the only measure of parallelism used; angles are taken
/// modulo pi, since rods have no head.
template <int D, class S> S abs_sine(const SpinePair<D, S> &p) { return norm(cross(p.u_i, p.u_j)); }

/// True when the two segments cross in the plane: each has its tips on opposite sides of the other.
template <class S> Truth<S> spines_cross(const SpinePair<2, S> &p)
{
  const S sine = abs(cross(p.u_i, p.u_j)[0]);
  return (abs(cross(p.u_j, p.r)[0]) < p.A_i * sine) & (abs(cross(p.u_i, p.r)[0]) < p.A_j * sine);
}
template <class S> Truth<S> spines_cross(const SpinePair<3, S> &) { return S(0.0) < S(0.0); }

/// Squared shortest distance of the two spines, zero where they cross.
template <int D, class S> S spine_distance_sq(const SpinePair<D, S> &p)
{
  return spines_cross(p) ? S(0.0) : closest_feet(p).distance_sq;
}

}  // namespace jamshape
