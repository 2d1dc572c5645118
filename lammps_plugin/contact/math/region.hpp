#pragma once

#include "contact/contact.hpp"
#include "contact/math/vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace jamshape {

/// Integrals over a region: of 1, of x_k, and of x_k x_l (xx, yy, zz, xy, xz, yz).
struct Moments {
  double measure = 0.0;
  Vec<3> first{};
  std::array<double, 6> second{};

  void add(double weight, const Moments &other)
  {
    measure += weight * other.measure;
    for (int k = 0; k < 3; ++k) first[k] += weight * other.first[k];
    for (int k = 0; k < 6; ++k) second[k] += weight * other.second[k];
  }
};

namespace detail {

/// Nodes and weights of Gauss and Legendre on [-1, 1], by Newton's method on the polynomial.
inline std::vector<std::pair<double, double>> gauss_legendre(int n)
{
  std::vector<std::pair<double, double>> rule;
  for (int k = 0; k < n; ++k) {
    double x = std::cos(M_PI * (k + 0.75) / (n + 0.5)), slope = 1.0;
    for (int step = 0; step < 100; ++step) {
      double before = 1.0, p = x;
      for (int m = 2; m <= n; ++m) {
        before = std::exchange(p, ((2 * m - 1) * x * p - (m - 1) * before) / m);
      }
      slope = n * (x * p - before) / (x * x - 1.0);
      const double change = p / slope;
      x -= change;
      if (std::abs(change) < 1e-15) break;
    }
    rule.emplace_back(x, 2.0 / ((1.0 - x * x) * slope * slope));
  }
  return rule;
}

}  // namespace detail

/// Adds the share of a piece of a boundary to the integrals over its region, by Green's theorem: at
/// points x, y with steps dx, dy.
inline void add_step(Moments &sum, double x, double y, double dx, double dy)
{
  sum.add(1.0,
          {0.5 * (x * dy - y * dx),
           {{0.5 * x * x * dy, -0.5 * y * y * dx, 0.0}},
           {x * x * x * dy / 3.0, -y * y * y * dx / 3.0, 0.0, 0.5 * x * x * y * dy, 0.0, 0.0}});
}

/// Adds an arc about (a, b) of radius R, counter-clockwise from one angle to another. Gauss and
/// Legendre's rule is exact to rounding on its trigonometric polynomials.
inline void add_arc(Moments &sum, double a, double b, double R, double from, double to)
{
  static const auto RULE = detail::gauss_legendre(16);
  const int parts = 1 + static_cast<int>((to - from) / M_PI * 2.0);
  const double half = 0.5 * (to - from) / parts;
  for (int part = 0; part < parts; ++part) {
    for (const auto &[node, weight] : RULE) {
      const double angle = from + half * (2 * part + 1 + node), w = half * weight * R;
      const double c = std::cos(angle), s = std::sin(angle);
      add_step(sum, a + R * c, b + R * s, -w * s, w * c);
    }
  }
}

/// Adds a straight piece from one point to another.
inline void add_line(Moments &sum, const Vec<2> &from, const Vec<2> &to)
{
  static const auto RULE = detail::gauss_legendre(4);
  const Vec<2> half = 0.5 * (to - from), middle = 0.5 * (to + from);
  for (const auto &[node, weight] : RULE) {
    add_step(sum, middle[0] + node * half[0], middle[1] + node * half[1], weight * half[0],
             weight * half[1]);
  }
}

/// Whether a body's integrals are those about its centre and along its principal axes.
inline bool are_principal(const Moments &of)
{
  // More than the error of the integrals over balls.
  constexpr double ROUNDING = 1e-7;
  const double size = std::sqrt((of.second[0] + of.second[1] + of.second[2]) / of.measure);
  double off = 0.0;
  for (int k = 0; k < 3; ++k) off = std::max(off, std::abs(of.first[k]) / size);
  for (int k = 3; k < 6; ++k) off = std::max(off, std::abs(of.second[k]) / (size * size));
  return off <= ROUNDING * of.measure;
}

/// Area (volume) and moments from integrals about the centre along principal axes.
inline SubstrateDrag drag_of(const Moments &by)
{
  const double xx = by.second[0], yy = by.second[1], zz = by.second[2], all = by.measure;
  return {all, {{(yy + zz) / all, (xx + zz) / all, (xx + yy) / all}}};
}

/// Area (volume) and moments of a body that is larger by a factor.
template <int D> SubstrateDrag scaled(SubstrateDrag drag, double scale)
{
  for (int k = 0; k < D; ++k) drag.measure *= scale;
  drag.moment = (scale * scale) * drag.moment;
  return drag;
}

/// The factor by which a body is larger than one of these half extents; nothing if it has other
/// proportions.
inline std::optional<double> scale_of(const Vec<3> &semi_axes, const Vec<3> &half_extents)
{
  constexpr double ROUNDING = 1e-9;
  const double scale = semi_axes[0] / half_extents[0];
  if (!(scale > 0.0) || !std::isfinite(scale)) return std::nullopt;
  for (int k = 1; k < 3; ++k) {
    const double expected = scale * half_extents[k];
    if (!(std::abs(semi_axes[k] - expected) <= ROUNDING * expected)) return std::nullopt;
  }
  return scale;
}

/// The body axis about which area (volume) lies closest, if there is one: the long axis of long
/// particles; flat ones and those of higher symmetry have none.
template <int D> std::optional<int> long_axis_of(const Vec<3> &moment)
{
  constexpr double ISOTROPIC = 1e-6;  // relative difference that rounding and quadrature leave
  int order[3] = {0, 1, 2};
  std::stable_sort(order, order + D, [&](int a, int b) { return moment[a] < moment[b]; });
  const bool is_long = moment[order[0]] < (1.0 - ISOTROPIC) * moment[order[1]];
  return is_long ? std::optional<int>(order[0]) : std::nullopt;
}

}  // namespace jamshape
