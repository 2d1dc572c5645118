#pragma once

#include "contact/vec.hpp"

#include <algorithm>
#include <cmath>

namespace jamshape {

/// Two spines (segments) in relative coordinates: r = centre of i - centre of j; u unit vectors,
/// A half lengths. Only differences of positions enter, so no digits are lost far from the origin.
template <int D> struct SpinePair {
  Vec<D> r;
  Vec<D> u_i;
  double A_i;
  Vec<D> u_j;
  double A_j;
};

/// A point on each spine, s along u_i from the centre of i and t along u_j from the centre of j,
/// and the vector from the point on j to the point on i.
template <int D> struct Feet {
  double s, t;
  Vec<D> delta;
  double distance_sq;
};

template <int D> Feet<D> feet_at(const SpinePair<D> &p, double s, double t)
{
  const Vec<D> delta = p.r + s * p.u_i - t * p.u_j;
  return {s, t, delta, norm_sq(delta)};
}

/// Foot on spine j of the point s of spine i, and the reverse.
template <int D> Feet<D> foot_on_j(const SpinePair<D> &p, double s)
{
  const Vec<D> from_j = p.r + s * p.u_i;
  const double t = std::clamp(dot(p.u_j, from_j), -p.A_j, p.A_j);
  const Vec<D> delta = from_j - t * p.u_j;
  return {s, t, delta, norm_sq(delta)};
}

template <int D> Feet<D> foot_on_i(const SpinePair<D> &p, double t)
{
  const Vec<D> to_i = p.r - t * p.u_j;
  const double s = std::clamp(-dot(p.u_i, to_i), -p.A_i, p.A_i);
  const Vec<D> delta = to_i + s * p.u_i;
  return {s, t, delta, norm_sq(delta)};
}

/// The closest approach at either end of the pair: at end e = +, - the shorter of (tip e of i to
/// spine j) and (tip of j at the same end to spine i), the spines aligned by the sign of u_i.u_j.
/// For nearly parallel rods these are the two ends of the overlap of the spines.
template <int D> struct EndFeet {
  Feet<D> plus, minus;

  const Feet<D> &nearer() const { return minus.distance_sq < plus.distance_sq ? minus : plus; }
  const Feet<D> &farther() const { return minus.distance_sq < plus.distance_sq ? plus : minus; }

  /// Distance between the two ends, the mean over both spines. The mean, not the value on one
  /// spine: it does not change when i and j are exchanged, nor when the nearer tip of an end
  /// changes.
  double spread() const { return 0.5 * (std::abs(plus.s - minus.s) + std::abs(plus.t - minus.t)); }
};

template <int D> EndFeet<D> end_feet(const SpinePair<D> &p)
{
  const double aligned_A_j = std::copysign(p.A_j, dot(p.u_i, p.u_j));
  const auto shorter = [](const Feet<D> &a, const Feet<D> &b) {
    return b.distance_sq < a.distance_sq ? b : a;
  };
  return {shorter(foot_on_j(p, p.A_i), foot_on_i(p, aligned_A_j)),
          shorter(foot_on_j(p, -p.A_i), foot_on_i(p, -aligned_A_j))};
}

/// Closest approach of the two spines. In 2D, spines that do not cross are closest at a tip; skew
/// spines in 3D may be closest inside both. Crossing spines in 2D are a state to detect
/// (`spines_cross`): their shortest distance, zero, is not what this returns.
inline Feet<2> closest_feet(const SpinePair<2> &, const EndFeet<2> &ends) { return ends.nearer(); }

inline Feet<3> closest_feet(const SpinePair<3> &p, const EndFeet<3> &ends)
{
  // The part of u_i across u_j, from the difference of the axes: nearly parallel spines lose no
  // digits.
  const Vec<3> turn = p.u_i - std::copysign(1.0, dot(p.u_i, p.u_j)) * p.u_j;
  const Vec<3> across = turn - dot(turn, p.u_j) * p.u_j;
  const double sin_sq = norm_sq(across);
  if (sin_sq == 0.0) return ends.nearer();
  const double s = -dot(p.r, across) / sin_sq;
  const double t = dot(p.u_j, p.r + s * p.u_i);
  // Feet inside both spines are the minimum, the distance being convex: comparing it with that at
  // the ends would leave it to rounding where the feet of nearly parallel spines sit.
  if (std::abs(s) < p.A_i && std::abs(t) < p.A_j) return foot_on_i(p, t);
  return ends.nearer();
}

/// |sin| of the angle between the spines: the one measure of being parallel used everywhere; it
/// takes angles modulo pi, since rods have no head.
template <int D> double abs_sine(const SpinePair<D> &p) { return norm(cross(p.u_i, p.u_j)); }

/// True when the two segments cross in the plane: each has its tips on opposite sides of the other.
inline bool spines_cross(const SpinePair<2> &p)
{
  const double sine = std::abs(cross(p.u_i, p.u_j)[0]);
  return std::abs(cross(p.u_j, p.r)[0]) < p.A_i * sine &&
         std::abs(cross(p.u_i, p.r)[0]) < p.A_j * sine;
}
inline bool spines_cross(const SpinePair<3> &) { return false; }

/// Squared shortest distance of the two spines, zero where they cross.
template <int D> double spine_distance_sq(const SpinePair<D> &p)
{
  if (spines_cross(p)) return 0.0;
  return closest_feet(p, end_feet(p)).distance_sq;
}

}  // namespace jamshape
