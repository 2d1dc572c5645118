#pragma once

#include "contact/math/smooth_step.hpp"
#include "contact/spherocylinder/segment_segment.hpp"

namespace jamshape {

/// Depth y of two bonds: mean overlap (a length) over A_min^2 / d, A_min the shorter half length.
/// Beyond SHALLOW they merge into one, and the length over which the second bond fades in grows
/// from FADE_LENGTH A_min to A_min. Below the smallest exponent, the norm is taken as the larger
/// bond.
inline constexpr double SHALLOW = 0.01;
inline constexpr double FADE_LENGTH = 0.05;
inline constexpr double FADE_GROWTH = 4.0;
inline constexpr double LEAST_END_EXPONENT = 1e-12;

/// Share of the energy below which a second bond does not count: near where it underflows, numbers
/// of bonds would depend on the processor.
inline constexpr double LEAST_SHARE = 1e-100;

/// A function's value, and its derivative.
template <class S> struct ValueAndSlope {
  S value, slope;
};

/// h = g^3 / (g^2 + SHALLOW^2), g = y - SHALLOW: 0 below SHALLOW, about y far above, C2.
template <class S> ValueAndSlope<S> growth_of(const S &y)
{
  const S g = most(S(y - SHALLOW), S(0.0));
  const S square = g * g, sum = square + SHALLOW * SHALLOW;
  return {g * square / sum, square * (sum + 2.0 * SHALLOW * SHALLOW) / (sum * sum)};
}

/// L / A_min = ((e^2 + k^2 h^2) / (1 + k^2 h^2))^(1/2), e = FADE_LENGTH, k = FADE_GROWTH.
template <class S> ValueAndSlope<S> fade_length(const S &h)
{
  const S part = FADE_GROWTH * FADE_GROWTH * h, one = 1.0 + part * h;
  const double e_sq = FADE_LENGTH * FADE_LENGTH;
  const S length = sqrt((e_sq + part * h) / one);
  return {length, part * (1.0 - e_sq) / (one * one * length)};
}

/// Two rods side to side: u_i.r, u_j.r, c = u_i.u_j and their depth, infinite for discs. The length
/// facing i is q_i = A_i + A_j |c| - |u_i.r|; `opposite` is the harmonic mean of both, 0 if either
/// is not positive.
template <class S> struct SideBySide {
  Plain<S> shorter, depth_per_overlap;
  S along_i, along_j, cosine, depth, opposite_i, opposite_j, opposite;

  template <int D>
  SideBySide(const SpinePair<D, S> &p, const S &mean_overlap, const Plain<S> &reach) :
      shorter(least(p.A_i, p.A_j)), depth_per_overlap(reach / shorter * (reach / shorter)),
      along_i(dot(p.u_i, p.r)), along_j(dot(p.u_j, p.r)), cosine(dot(p.u_i, p.u_j)),
      depth(mean_overlap * depth_per_overlap),
      opposite_i(p.A_i + p.A_j * abs(cosine) - abs(along_i)),
      opposite_j(p.A_j + p.A_i * abs(cosine) - abs(along_j)), opposite(0.0)
  {
    const Truth<S> both = (opposite_i > S(0.0)) & (opposite_j > S(0.0));
    if (any(both))
      opposite = select(both, 2.0 * opposite_i * opposite_j / (opposite_i + opposite_j), opposite);
  }

  /// Whether the exponent is 1, as for most pairs, or 0, without computing it.
  Truth<S> has_two_bonds() const
  {
    const S length = least(opposite, S(2.0 * shorter * abs(cosine)));
    return (depth <= S(SHALLOW)) & (S(FADE_LENGTH * shorter) <= length);
  }
  Truth<S> has_one_bond() const
  {
    return !((opposite > S(0.0)) & (depth * LEAST_END_EXPONENT < S(1.0)));
  }
};

/// Exponent of the norm of the overlaps at the two ends,
///     w = S(q / L) S(2 A_min |c| / L) / (1 + h^2)^(1/2),   1 / q = (1 / q_i + 1 / q_j) / 2,
/// S the smooth step. It is 0 where the two ends become one point and where they change partners (c
/// = 0); with its derivatives by the four invariants u_i.r, u_j.r, c and the mean overlap.
template <class S> struct EndExponent {
  S value, by_along_i, by_along_j, by_cosine, by_mean;

  template <int D> EndExponent(const SpinePair<D, S> &p, const SideBySide<S> &at)
  {
    const ValueAndSlope<S> h = growth_of<S>(at.depth), L = fade_length(h.value);
    const S inverse = 1.0 / (at.shorter * L.value), flat = 1.0 / sqrt(1.0 + h.value * h.value);
    const S x = at.opposite * inverse, x_c = 2.0 * at.shorter * abs(at.cosine) * inverse;
    const S by_x = smooth_step_gradient(x) * smooth_step(x_c) * flat;
    const S by_x_c = smooth_step(x) * smooth_step_gradient(x_c) * flat;
    value = smooth_step(x) * smooth_step(x_c) * flat;
    const S part_i = at.opposite / at.opposite_i, part_j = at.opposite / at.opposite_j;
    const S by_i = 0.5 * by_x * inverse * part_i * part_i;
    const S by_j = 0.5 * by_x * inverse * part_j * part_j;
    by_along_i = -copysign(by_i, at.along_i);
    by_along_j = -copysign(by_j, at.along_j);
    const S by_size = by_i * p.A_j + by_j * p.A_i + 2.0 * at.shorter * inverse * by_x_c;
    by_cosine = copysign(by_size, at.cosine);
    const S by_L = by_x * x + by_x_c * x_c, by_h = value * h.value * flat * flat;
    by_mean = -(by_h + by_L * L.slope / L.value) * h.slope * at.depth_per_overlap;
  }
};

/// ln(b / a) of the overlaps a >= b > 0 of the nearer and the farther end: from the difference of
/// the feet, since the overlaps may differ by less than their rounding.
template <int D, class S>
S log_ratio_of(const SpinePair<D, S> &p, const Feet<D, S> &near, const Feet<D, S> &far,
               const Plain<S> &reach)
{
  const S distance = sqrt(near.distance_sq), far_distance = sqrt(far.distance_sq);
  const Vec<D, S> step = (far.s - near.s) * p.u_i - (far.t - near.t) * p.u_j;
  const S drop = dot(step, far.delta + near.delta) / (far_distance + distance);
  const S lost = with_value(drop, most(value_of(drop), ValueOf<S>(0.0))) / (reach - distance);
  const Truth<S> little = lost < S(0.5);
  if (all(little)) return log1p(-lost);
  const S of_overlaps = log((reach - far_distance) / (reach - distance));
  return any(little) ? select(little, log1p(-lost), of_overlaps) : of_overlaps;
}

/// The norm V = (E(a)^(1/w) + E(b)^(1/w))^w of two energies that grow as a power of the overlap,
/// from ln(b / a): their fractions of the sum, shares in V = share_a E(a) + share_b E(b), and d ln
/// V / dw, the entropy of the fractions.
template <class S> struct EndNorm {
  S part_a, part_b, share_a, share_b, entropy;

  EndNorm(const S &log_ratio, const S &w, double power)
  {
    const S log_t = power / w * log_ratio, t = exp(log_t), log_sum = log1p(t);
    part_a = 1.0 / (1.0 + t);
    part_b = t * part_a;
    share_a = exp((w - 1.0) * log_sum);
    share_b = exp(log_t - power * log_ratio) * share_a;
    entropy = log_sum - part_b * log_t;
  }
};

}  // namespace jamshape
