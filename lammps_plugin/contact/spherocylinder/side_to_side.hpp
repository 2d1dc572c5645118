#pragma once

#include "contact/harmonic.hpp"
#include "contact/math/smooth_step.hpp"
#include "contact/math/vec.hpp"
#include "contact/spherocylinder/segment_segment.hpp"

#include <algorithm>
#include <cmath>

namespace jamshape {

/// The second bond of rods that lie side to side fades in over this fraction of the shorter half
/// length A_min of spine overlap, up to all of A_min where they are not SHALLOW, and over this
/// range of |cos| of the angle. A bond of less than LEAST_WEIGHT is none.
inline constexpr double FADE_LENGTH = 0.05;
inline constexpr double FADE_COSINE_START = 0.5;
inline constexpr double FADE_COSINE_RANGE = 0.35;
inline constexpr double LEAST_WEIGHT = 1e-12;

/// Before its foot stops at a tip it slows down over this fraction of that overlap.
inline constexpr double FADE_CORNER = 0.25;

/// Mean overlaps (as lengths) over A_min^2 / d. Around 1, rods that part turn so far that their
/// feet move by A_min: the second bond fades in over a wider range while they grow from SHALLOW to
/// 1, and two bonds become one while they grow from 1 to DEEP. The one is then free of a kink for
/// rods that are parallel to the sine DEEP_SINE, in units of A_min / d: at larger angles the feet
/// of the two ends, moving by d sin, are too far from where the ends are.
inline constexpr double SHALLOW = 0.01;
inline constexpr double DEEP = 16.0;
inline constexpr double DEEP_SINE = 0.1;

/// What a mean overlap makes of a contact, y = overlap over (A_min / d)^2: B = S(1 - ln y / ln
/// SHALLOW) of the fade's range, and of the two bonds D = 1 - S(ln y / ln DEEP); with their
/// derivatives by the overlap.
template <class S> struct Depth {
  S wide{0.0}, wide_gradient{0.0};
  S two_bonds{1.0}, two_bonds_gradient{0.0};

  Depth(const S &mean_overlap, double shorter, double reach)
  {
    const S y = mean_overlap * reach * reach / (shorter * shorter);
    if (!(y > SHALLOW)) return;
    const double range = y < 1.0 ? -std::log(SHALLOW) : std::log(DEEP);
    const S x = log(y) / range, gradient = 1.0 / (range * mean_overlap);
    if (y < 1.0) {
      wide = smooth_step(1.0 + x);
      wide_gradient = smooth_step_gradient(1.0 + x) * gradient;
    } else {
      wide = 1.0;
      two_bonds = 1.0 - smooth_step(x);
      two_bonds_gradient = -smooth_step_gradient(x) * gradient;
    }
  }
};

/// `limited` that slows down over a length before the bounds, twice continuously differentiable,
/// and ends half of that length inside them; with its derivatives.
template <class S> struct SoftlyLimited {
  S value, slope, per_length;

  SoftlyLimited(const S &x, double bound, const S &length)
  {
    const S inside = std::min<S>(abs(x), bound);
    const S y = std::max<S>((inside - bound) / length + 1.0, 0.0);
    const S lost = y * y * y * (1.0 - 0.5 * y), rate = y * y * (3.0 - 2.0 * y);
    value = copysign(inside - length * lost, x);
    slope = abs(x) < bound ? 1.0 - rate : S(0.0);
    per_length = copysign(S(1.0), x) * (rate * (y - 1.0) - lost);
  }
};

/// How much of either spine lies opposite the other one: the distance between the feet of the other
/// spine's tips, the mean over both spines; for parallel ones the overlap of the spines. Feet slow
/// down over a length before they stop at a tip, so that it has no corners.
template <int D, class S> struct OppositeParts {
  S mean{0.0}, per_length{0.0};
  S per_foot_on_i[2]{}, per_foot_on_j[2]{};  // derivatives, for the feet of the other's + and - tip

  OppositeParts() = default;
  OppositeParts(const SpinePair<D, S> &p, const S &length)
  {
    const double sign = dot(p.u_i, p.u_j) < S(0.0) ? -0.5 : 0.5;
    const auto add = [&](double weight, const S &foot, double bound, S &per_foot) {
      const SoftlyLimited<S> soft(foot, bound, length);
      mean += weight * soft.value;
      per_length += weight * soft.per_length;
      per_foot = weight * soft.slope;
    };
    const S middle_of_i = -dot(p.u_i, p.r), middle_of_j = dot(p.u_j, p.r);
    const S cosine = dot(p.u_i, p.u_j), half_i = p.A_i * cosine, half_j = p.A_j * cosine;
    add(sign, middle_of_i + half_j, p.A_i, per_foot_on_i[0]);
    add(-sign, middle_of_i - half_j, p.A_i, per_foot_on_i[1]);
    add(sign, middle_of_j + half_i, p.A_j, per_foot_on_j[0]);
    add(-sign, middle_of_j - half_i, p.A_j, per_foot_on_j[1]);
  }
};

/// Weight of a bond of rods side to side, S(l / length) times a function of the angle, l the
/// opposite parts of the spines; with its derivatives by l, by the length and by u_i.u_j.
template <int D, class S> struct BondWeight {
  OppositeParts<D, S> opposite;
  S value{0.0}, per_part{0.0}, per_length{0.0}, per_cosine{0.0};

  BondWeight() = default;
  BondWeight(const SpinePair<D, S> &p, const S &length, const S &of_angle, const S &gradient) :
      opposite(p, FADE_CORNER * length)
  {
    const S x = opposite.mean / length, by_length = smooth_step(x);
    value = by_length * of_angle;
    per_part = smooth_step_gradient(x) / length * of_angle;
    per_length = per_part * (FADE_CORNER * opposite.per_length - x);
    per_cosine = by_length * gradient;
  }
};

/// W_b = S(l / L) S((|cos| - 0.5) / 0.35), S the smooth step. It goes to 0 smoothly where the
/// second bond ends: at spines that just begin to overlap and at large angles, where the rule of
/// Marschall & Teitel (Fig. 6) jumps.
template <int D, class S> BondWeight<D, S> second_weight(const SpinePair<D, S> &p, const S &length)
{
  const S cosine = dot(p.u_i, p.u_j);
  const S x = (abs(cosine) - FADE_COSINE_START) / FADE_COSINE_RANGE;
  const S gradient = copysign(smooth_step_gradient(x) / FADE_COSINE_RANGE, cosine);
  return {p, length, smooth_step(x), gradient};
}

/// W_m = S(l / (0.05 A_min)) (1 - S((sin d / (0.1 A_min))^2)).
template <int D, class S>
BondWeight<D, S> mean_weight(const SpinePair<D, S> &p, double shorter, double reach)
{
  const double sine = DEEP_SINE * shorter / reach;
  const S x = norm_sq(cross(p.u_i, p.u_j)) / (sine * sine);
  const S gradient = 2.0 * dot(p.u_i, p.u_j) * smooth_step_gradient(x) / (sine * sine);
  return {p, FADE_LENGTH * shorter, 1.0 - smooth_step(x), gradient};
}

/// Whether rods that touch at both ends have two whole bonds because they are shallow, nearly
/// parallel and far enough side by side: most have, and need no weights.
template <int D, class S>
bool are_plainly_whole(const SpinePair<D, S> &p, const S &overlap, double reach)
{
  const double shorter = std::min(p.A_i, p.A_j);
  const S cosine = abs(dot(p.u_i, p.u_j));
  if (overlap * reach * reach > SHALLOW * shorter * shorter) return false;
  if (cosine < FADE_COSINE_START + FADE_COSINE_RANGE) return false;
  const auto part = [&](const S &middle, double bound, const S &half) {
    return limited<S>(middle + half, bound) - limited<S>(middle - half, bound);
  };
  const S opposite =
      part(dot(p.u_i, p.r), p.A_i, p.A_j * cosine) + part(dot(p.u_j, p.r), p.A_j, p.A_i * cosine);
  // Feet that slow down lose at most the length over which they do.
  return opposite >= 2.0 * (1.0 + FADE_CORNER) * FADE_LENGTH * shorter;
}

/// Overlaps a of the nearer end, b of the farther one, their mean m, and a - m: from the difference
/// of the feet, since the overlaps differ by less than they round. By definition b <= a, which
/// rounding is not to deny where a power of b / a is taken: the power may be 1e12.
template <class S> struct EndOverlaps {
  S a, b, mean, drop;

  template <int D>
  EndOverlaps(const SpinePair<D, S> &p, const Feet<D, S> &near, const Feet<D, S> &far, double reach)
  {
    const S distance = sqrt(near.distance_sq), far_distance = sqrt(far.distance_sq);
    const S inverse_reach = S(1.0) / reach;
    a = (reach - distance) * inverse_reach;
    b = (reach - far_distance) * inverse_reach;
    mean = 0.5 * (a + b);
    const Vec<D, S> step = (far.s - near.s) * p.u_i - (far.t - near.t) * p.u_j;
    drop = 0.5 * inverse_reach * dot(step, far.delta + near.delta) / (far_distance + distance);
    drop = with_value(drop, std::max<ValueOf<S>>(value_of(drop), 0.0));
  }

  /// b / a, and its logarithm, of two overlaps above zero.
  S ratio() const
  {
    const S quotient = b / a;
    return with_value(quotient, std::min<ValueOf<S>>(value_of(quotient), 1.0));
  }
  S log_ratio() const
  {
    const S lost = 2.0 * drop / a;
    return lost < 0.5 ? log1p(-lost) : log(ratio());
  }
};

/// Energy of the second bond, F = W E(a) (b / a)^(2 + B (1/W - 1)): W E(b) for overlaps that are
/// small (B = 0). At the other end of B, E(a) + F has no kink where a and b change places. Beside
/// what is W E(b): energy and derivatives; by the weight and by B, of all of F.
template <class S> struct SecondBond {
  S energy{0.0}, rest{0.0}, rest_by_a{0.0}, rest_by_b{0.0}, by_weight{0.0}, by_wide{0.0};

  SecondBond() = default;
  SecondBond(const Harmonic &law, const EndOverlaps<S> &of, const S &weight, const S &wide)
  {
    const S E_b = law.energy(of.b), f_b = law.energy_gradient(of.b);
    const S ratio = of.ratio(), log_ratio = of.log_ratio();
    const S excess = (1.0 - weight) * wide;  // of the power, times the weight
    const S grown = expm1(excess / weight * log_ratio);
    const S whole = E_b + E_b * grown;
    rest = weight * E_b * grown;
    energy = weight * E_b + rest;
    rest_by_a = -0.5 * excess * f_b * ratio * (1.0 + grown);
    rest_by_b = f_b * (weight * grown + 0.5 * excess * (1.0 + grown));
    by_weight = whole * (1.0 - log_ratio * wide / weight);
    by_wide = whole * log_ratio * (1.0 - weight);
  }
};

/// All that two rods side to side have beside the bond of their nearer end.
template <int D, class S> struct SideToSide {
  EndOverlaps<S> overlap;
  Depth<S> depth;
  BondWeight<D, S> second, mean;

  SideToSide(const SpinePair<D, S> &p, const Feet<D, S> &near, const Feet<D, S> &far,
             double reach) : overlap(p, near, far, reach), depth(overlap.mean, shorter(p), reach)
  {
    if (depth.two_bonds > 0.0) second = second_weight(p, fade_length(p, depth.wide));
    if (depth.two_bonds < 1.0) mean = mean_weight(p, shorter(p), reach);
  }

  bool has_second() const
  {
    return overlap.a > 0.0 && overlap.b > 0.0 && depth.two_bonds > 0.0 &&
           second.value > LEAST_WEIGHT;
  }
  bool has_mean() const { return mean.value > 0.0 && depth.two_bonds < 1.0; }
  bool has_two_whole_bonds() const
  {
    return overlap.b > 0.0 && depth.two_bonds == 1.0 && second.value == 1.0;
  }

  static double shorter(const SpinePair<D, S> &p) { return std::min(p.A_i, p.A_j); }

  /// Of the second bond, and its derivative by B.
  static S fade_length(const SpinePair<D, S> &p, const S &wide)
  {
    return shorter(p) * FADE_LENGTH + fade_length_per_wide(p) * wide;
  }
  static double fade_length_per_wide(const SpinePair<D, S> &p)
  {
    return shorter(p) * (1.0 - FADE_LENGTH);
  }
};

}  // namespace jamshape
