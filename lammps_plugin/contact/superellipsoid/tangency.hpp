#pragma once

#include "contact/math/vec.hpp"
#include "contact/superellipsoid/barrier.hpp"
#include "contact/superellipsoid/equations.hpp"
#include "contact/superellipsoid/mixed.hpp"
#include "contact/superellipsoid/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace jamshape {

/// A Newton step shorter than this fraction of the unknowns is the last.
inline constexpr double SHORT_STEP = 1e-9;

/// The same in a scalar of higher precision: the error left by such a step, its square, is below
/// that precision.
template <class T> constexpr double short_step()
{
  constexpr int DIGITS = std::numeric_limits<T>::digits;
  return DIGITS <= 53 ? SHORT_STEP : DIGITS <= 64 ? 1e-11 : 1e-18;
}

/// A tangency found by iteration: eta lies in scale (1 +- gap), regardless of convergence.
template <int D, class T> struct FoundTangency {
  Tangency<D, T> at;
  T gap;
  int iterations;
  bool is_fallback;
  bool is_apart;    // decided by a separating plane, without a search for the tangency
  bool is_settled;  // the iteration converged, its bounds meet, and its equations have one solution
};

/// A gap between the bounds of the scale is far below the overlap if it is less than this fraction
/// of it.
inline constexpr double FAR_BELOW = 1e-3;

/// Whether the leading digits of an overlap, 1 - scale^2, are determined by its bounds.
template <class T> Truth<T> is_far_below(const T &gap, const T &scale)
{
  return gap <= T(FAR_BELOW) * abs((T(1.0) - scale) * (T(1.0) + scale));
}

/// Whether double precision is insufficient to decide if two bodies touch, and with which force.
template <int D> bool needs_digits(const FoundTangency<D, double> &found)
{
  if (found.is_apart || found.at.scale * (1.0 - found.gap) >= 1.0) return false;
  return !found.is_settled || !is_far_below(found.gap, found.at.scale);
}

/// Options of the search: r = x_i - x_j, whether it may stop with "apart" if a plane separates the
/// bodies, an initial normal (or null), and whether ellipsoids may take their closed path.
template <int D, class T> struct TangencyWish {
  Vec<D, T> r;
  bool may_stop_apart;
  const Vec<D, T> *last;
  bool shortcuts = true;
};

/// Bounds of the scale, |scale - eta| / scale < gap: the plane with normal n gives the lower one,
/// r.n / (h_i + h_j), a point y the upper, max(g_i(y), g_j(r - y)). One half of each follows from
/// how the equations derive the tangency from their unknowns.
template <int D, class T>
T gap_of(const detail::TangencyProblem<D, T> &pair, const Tangency<D, T> &at)
{
  using Norm = PowerNorm<D, T>;
  using detail::Coordinates;
  const Coordinates by_i = detail::coordinates_of(pair.i), by_j = detail::coordinates_of(pair.j);
  const auto larger = [](const T &a, const T &b) { return most(a, b) + T(0.0) * b; };  // or NaN
  T gap = most(T(Norm::gauge(pair.j).value(pair.r - at.point_i) - at.scale), T(0.0));
  if (by_i != Coordinates::NORMAL) {
    gap = larger(gap, Norm::gauge(pair.i).value(at.point_i) - at.scale);
  }
  if (by_i == Coordinates::MIXED || by_j == Coordinates::MIXED) {
    const T widths =
        Norm::support(pair.i).value(at.normal) + Norm::support(pair.j).value(at.normal);
    gap = larger(gap, at.scale - dot(pair.r, at.normal) / widths);
  } else if (by_j == Coordinates::POINT) {
    const T below = dot(pair.r, at.normal) / (T(1.0) + Norm::support(pair.j).value(at.normal));
    gap = larger(gap, at.scale - below);
  }
  return gap / at.scale;
}

/// Finds the tangency of two bodies in plain numbers T. Starting from the ellipsoids of the same
/// axes, where Newton's method takes four steps, it follows the solution as the exponents grow, in
/// stages of a few Newton steps each. If a stage fails, it starts again with finer ones, then from
/// points of the central path of a barrier, which exist and are found for every pair. Method and
/// measurements: analysis/contact_error.py.
template <int D, class T> class TangencySearch {
 public:
  using Body = SuperellipsoidBody<D, T>;

  /// Bodies are symmetric about their centres, so that exchanging them leaves r unchanged.
  TangencySearch(const Body &body_i, const Body &body_j, const TangencyWish<D, T> &wish) :
      r(wish.r), may_stop_apart(wish.may_stop_apart), shortcuts(wish.shortcuts),
      is_swapped(detail::is_by_normal(body_i) && !detail::is_by_normal(body_j)),
      i(is_swapped ? body_j : body_i), j(is_swapped ? body_i : body_j)
  {
  }

  /// Relative gap at which a tangency counts as found: the bounds then agree to rounding.
  static constexpr T GAP = 64 * std::numeric_limits<T>::epsilon();

  FoundTangency<D, T> find() const
  {
    FoundTangency<D, T> found{};
    const detail::ByNormalOfEllipsoids<D, T> ellipsoids(i, j, r);
    Vec<D, T> n = ellipsoids.start();
    if (are_ellipsoids()) return of_ellipsoids(ellipsoids, n);
    newton(ellipsoids, n, ROUGH, found.iterations);
    found.at = ellipsoids.tangency(n);
    if (may_stop_apart && separates(n)) return apart(found, n);
    follow(found);
    return ordered(found);
  }

  /// Searches from a nearby normal; if that fails, without it.
  FoundTangency<D, T> find_from(const Vec<D, T> &n) const
  {
    using Norm = PowerNorm<D, T>;
    FoundTangency<D, T> found{};
    if (!(dot(r, n) > T(0))) return find();
    if (are_ellipsoids()) {
      const detail::ByNormalOfEllipsoids<D, T> ellipsoids(i, j, r);
      found = of_ellipsoids(ellipsoids, ellipsoids.scaled(n));
      return found.is_settled ? found : find();
    }
    if (may_stop_apart && separates(n)) return apart(found, n);
    const auto h_i = Norm::support(i).at(n), h_j = Norm::support(j).at(n);
    const T scale = dot(r, n) / (h_i.value + h_j.value);
    found.at = {scale, n, scale * h_i.gradient, scale * h_j.gradient};
    return is_found(found, 1.0) ? ordered(found) : find();
  }

  /// Whether the scale is below 1, or nothing if doubles cannot decide; stops early at a point
  /// inside both bodies or a plane between them.
  std::optional<bool> is_overlap() const
  {
    FoundTangency<D, T> found{};
    const detail::ByNormalOfEllipsoids<D, T> ellipsoids(i, j, r);
    Vec<D, T> n = ellipsoids.start();
    newton(ellipsoids, n, ROUGH, found.iterations);
    found.at = ellipsoids.tangency(n);
    if (reach_of(found.at.point_i) < 1) return true;
    if (separates(n)) return false;
    if (are_ellipsoids()) {
      found = of_ellipsoids(ellipsoids, ellipsoids.scaled(n));
    } else {
      follow(found);
    }
    if (needs_digits(found)) return std::nullopt;
    return found.at.scale < 1;
  }

  /// Improves a nearby tangency, found before or in lower precision; false on failure.
  bool improve(FoundTangency<D, T> &found) const
  {
    found = ordered(found);
    const bool is_improved = is_found(found, 1.0);
    found = ordered(found);
    return is_improved;
  }

  void certify(FoundTangency<D, T> &found) const
  {
    const T gap = gap_of(detail::TangencyProblem<D, T>::of(i, j, r), found.at);
    const bool is_bound = isfinite(gap) && found.at.scale > T(0);
    found.gap = is_bound ? gap : std::numeric_limits<T>::infinity();
  }

 private:
  Vec<D, T> r;
  bool may_stop_apart, shortcuts, is_swapped;
  const Body &i, &j;  // a body by its normal comes last

  static constexpr T TOLERANCE = T(short_step<T>());
  static constexpr T ROUGH = T(1e-2);
  static constexpr double RATIOS[] = {3.0, 1.5};  // ratio of exponents, stage to stage
  static constexpr double BARRIERS[] = {1e-4,  1e-6,  1e-8,  1e-9,  1e-10, 1e-11, 1e-12, 1e-13,
                                        1e-15, 1e-17, 1e-20, 1e-23, 1e-26, 1e-29};  // their last mu

  bool are_ellipsoids() const { return shortcuts && i.is_ellipsoid() && j.is_ellipsoid(); }

  FoundTangency<D, T> of_ellipsoids(const detail::ByNormalOfEllipsoids<D, T> &ellipsoids,
                                    Vec<D, T> n) const
  {
    FoundTangency<D, T> found{};
    // n has the length that `scaled` gives, where r.n is the square of r.n / F.
    if (may_stop_apart && dot(r, n) >= T(1)) return apart(found, n);
    newton(ellipsoids, n, TOLERANCE, found.iterations);
    found.at = ellipsoids.tangency(n);
    certify(found);
    found.is_settled = found.gap <= GAP;
    return found;
  }

  T widths(const Vec<D, T> &n) const
  {
    using Norm = PowerNorm<D, T>;
    return Norm::support(i).value(n) + Norm::support(j).value(n);
  }

  /// The scale at which both bodies contain a point.
  T reach_of(const Vec<D, T> &from_i) const
  {
    using Norm = PowerNorm<D, T>;
    return std::max(Norm::gauge(i).value(from_i), Norm::gauge(j).value(r - from_i));
  }

  bool separates(const Vec<D, T> &n) const { return dot(r, n) >= widths(n); }

  static FoundTangency<D, T> apart(FoundTangency<D, T> found, const Vec<D, T> &n)
  {
    found.is_apart = true;
    found.at.normal = n;
    found.at.scale = std::numeric_limits<T>::infinity();
    return found;
  }

  FoundTangency<D, T> ordered(FoundTangency<D, T> found) const
  {
    if (is_swapped) std::swap(found.at.point_i, found.at.point_j);
    return found;
  }

  /// Keeps the first attempt that ends in a short step and within bounds; if both bodies are so
  /// flat that steps stay long, the one with the closest bounds. Those from the central path differ
  /// by 20 times its mu, and rounding.
  void follow(FoundTangency<D, T> &found) const
  {
    const Tangency<D, T> start = found.at;
    FoundTangency<D, T> best = found;
    best.gap = std::numeric_limits<T>::infinity();
    for (const double ratio : RATIOS) {
      found.at = start;
      if (is_found(found, ratio)) return;
      if (found.gap < best.gap) best = found;
      found.is_fallback = true;
    }
    if (D == 3 && (i.has_two_exponents() || j.has_two_exponents())) {
      follow_centre(detail::ConeBarrier<D, T, D == 3>(i, j, r), found, best);
    } else {
      follow_centre(detail::ConeBarrier<D, T, false>(i, j, r), found, best);
    }
  }

  template <class Barrier>
  void follow_centre(Barrier barrier, FoundTangency<D, T> &found, FoundTangency<D, T> &best) const
  {
    for (const double mu : BARRIERS) {
      if (T(mu) < 50 * std::numeric_limits<T>::epsilon()) break;
      barrier.follow(T(mu), found.iterations);
      found.at = barrier.tangency();
      bound(found);
      if (found.gap < best.gap) best = found;
      if (is_found(found, 1.0)) return;
      if (found.gap < best.gap) best = found;
    }
    found.at = best.at;
    found.gap = best.gap;
    found.is_settled = false;
  }

  bool is_found(FoundTangency<D, T> &found, double ratio) const
  {
    const bool is_converged = to_own_exponents(found, ratio);
    certify(found);
    return is_converged && found.gap <= GAP;
  }

  /// Sets the bounds from a normal and a point that need not belong to each other.
  void bound(FoundTangency<D, T> &found) const
  {
    found.at.scale = reach_of(found.at.point_i);
    const T below = dot(r, found.at.normal) / widths(found.at.normal);
    found.gap = (found.at.scale - below) / found.at.scale;
    if (!(found.gap >= T(0))) found.gap = std::numeric_limits<T>::infinity();
  }

  /// Continues to the bodies' own exponents in stages of this ratio, or directly for ratio 1.
  bool to_own_exponents(FoundTangency<D, T> &found, double ratio) const
  {
    if constexpr (D == 3) {
      if (detail::is_mixed(i, j)) return in_stages<detail::ByBoth<T>>(found, ratio);
    }
    if (detail::is_by_normal(i)) return in_stages<detail::ByNormal<D, T>>(found, ratio);
    if (detail::is_by_normal(j)) return in_stages<detail::ByPointAndNormal<D, T>>(found, ratio);
    return in_stages<detail::ByPoint<D, T>>(found, ratio);
  }

  template <class Equations> bool in_stages(FoundTangency<D, T> &found, double ratio) const
  {
    const auto e_i = detail::smooth_powers<T>(i), e_j = detail::smooth_powers<T>(j);
    int last = 1;
    const T largest = std::max({e_i.axis, e_i.across, e_j.axis, e_j.across});
    const T most = ratio > 1.0 ? largest * T(1 - 1e-9) : T(1);
    for (T reached = T(ratio); reached < most; reached *= T(ratio)) ++last;
    Vec<Equations::M, T> z{};
    detail::NewtonEnd end{};
    for (int stage = 1; stage <= last; ++stage) {
      const T share = T(stage) / last;
      const Equations equations(
          detail::TangencyProblem<D, T>{i, j, r, stage < last ? between(e_i, share) : e_i,
                                        stage < last ? between(e_j, share) : e_j});
      if (stage == 1) z = equations.start(found.at);
      detail::Matrix<Equations::M, T> matrix{};
      end = newton(equations, z, stage < last ? ROUGH : TOLERANCE, found.iterations, &matrix);
      if (stage < last) continue;
      found.at = equations.tangency(z);
      found.is_settled = end == detail::NewtonEnd::SHORT_STEP;
      if constexpr (Equations::MAY_BE_ILL_POSED)
        found.is_settled = found.is_settled && Equations::is_well_posed(matrix);
    }
    return end != detail::NewtonEnd::FAILED;
  }

  static Powers<T> between(const Powers<T> &powers, T share)
  {
    return {between(powers.axis, share), between(powers.across, share)};
  }

  /// Integer powers need no logarithm.
  static T between(T exponent, T share)
  {
    const T power = pow(exponent, share);
    return exponent > 4 && share < 1 && round(power) > 1 ? round(power) : power;
  }
};

/// A vector in plain numbers T, without derivatives.
template <class T, int D, class S> Vec<D, T> plain(const Vec<D, S> &v)
{
  Vec<D, T> values;
  for (int k = 0; k < D; ++k) values[k] = static_cast<T>(value_of(v[k]));
  return values;
}

template <class T, int D, class S>
SuperellipsoidBody<D, T> plain(const SuperellipsoidBody<D, S> &body)
{
  SuperellipsoidBody<D, T> of;
  of.centre = plain<T>(body.centre);
  for (int k = 0; k < D; ++k) of.axis[k] = plain<T>(body.axis[k]);
  of.semi_axes = body.semi_axes;
  of.p = body.p;
  of.p_across = body.p_across;
  of.bounding_radius = body.bounding_radius;
  return of;
}

template <class T, int D, class S> Tangency<D, T> plain(const Tangency<D, S> &at)
{
  return {static_cast<T>(at.scale), plain<T>(at.normal), plain<T>(at.point_i),
          plain<T>(at.point_j)};
}

/// The tangency of two bodies, or only that they are apart if that suffices; starts from the normal
/// `last` if given (the pair's, at the previous step).
template <int D>
FoundTangency<D, double> tangency_of(const SuperellipsoidBody<D, double> &i,
                                     const SuperellipsoidBody<D, double> &j,
                                     const TangencyWish<D, double> &wish)
{
  const TangencySearch<D, double> search(i, j, wish);
  return wish.last == nullptr ? search.find() : search.find_from(*wish.last);
}

/// In long doubles, one or two steps from the solution in doubles.
template <int D>
FoundTangency<D, long double> tangency_of(const SuperellipsoidBody<D, long double> &i,
                                          const SuperellipsoidBody<D, long double> &j,
                                          const TangencyWish<D, long double> &wish)
{
  const SuperellipsoidBody<D, double> short_i = plain<double>(i), short_j = plain<double>(j);
  const auto begun =
      tangency_of(short_i, short_j, TangencyWish<D, double>{plain<double>(wish.r), false, nullptr});
  FoundTangency<D, long double> found{
      plain<long double>(begun.at), begun.gap, begun.iterations, begun.is_fallback, false, false};
  const TangencySearch<D, long double> search(i, j, wish);
  return search.improve(found) ? found : search.find();
}

/// The tangency in the scalar S of the bodies: one more Newton step from the one found in plain
/// numbers, its residual in S, its matrix plain. In dual numbers this is the implicit function
/// theorem, and the derivatives are exact.
template <int D, class S> class TangencyIn {
 public:
  using T = ValueOf<S>;
  using Body = SuperellipsoidBody<D, S>;
  using PlainBody = SuperellipsoidBody<D, T>;

  TangencyIn(const Body &body_i, const Body &body_j, const Vec<D, S> &separation) :
      i(body_i), j(body_j), r(separation)
  {
  }

  Tangency<D, S> from(const Tangency<D, T> &found) const
  {
    if (detail::is_by_normal(i) && !detail::is_by_normal(j)) {
      const Tangency<D, T> other{found.scale, found.normal, found.point_j, found.point_i};
      Tangency<D, S> at = TangencyIn(j, i, r).from(other);
      std::swap(at.point_i, at.point_j);
      return at;
    }
    using namespace detail;
    if constexpr (D == 3) {
      if (is_mixed(i, j)) return step<ByBoth<S>, ByBoth<T>>(found);
    }
    if (is_by_normal(i)) return step<ByNormal<D, S>, ByNormal<D, T>>(found);
    if (is_by_normal(j)) return step<ByPointAndNormal<D, S>, ByPointAndNormal<D, T>>(found);
    return step<ByPoint<D, S>, ByPoint<D, T>>(found);
  }

 private:
  const Body &i, &j;
  Vec<D, S> r;

  template <class InS, class Plain> Tangency<D, S> step(const Tangency<D, T> &found) const
  {
    const auto e_i = detail::smooth_powers<T>(i), e_j = detail::smooth_powers<T>(j);
    const PlainBody plain_i = plain<T>(i), plain_j = plain<T>(j);
    const Plain equations({plain_i, plain_j, plain<T>(r), e_i, e_j});
    const InS in_s({i, j, r, e_i, e_j});
    const auto z = equations.start(found);
    Vec<Plain::M, S> at;
    for (int k = 0; k < Plain::M; ++k) at[k] = z[k];
    const auto jacobian = equations.linearised(z).jacobian;
    at -= detail::solved(jacobian, in_s.residual(at));
    return in_s.tangency(at);
  }
};

}  // namespace jamshape
