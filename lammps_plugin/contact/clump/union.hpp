#pragma once

#include "contact/math/region.hpp"
#include "contact/math/vec.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace jamshape {

/// A disc in the plane of a body (z = 0 in 2D), or a ball.
struct Ball {
  Vec<3> centre;
  double radius;
};

namespace detail {

/// The parts of circle k that no other disc covers, as intervals of angles.
inline std::vector<std::pair<double, double>> free_arcs(const std::vector<Ball> &discs,
                                                        std::size_t k)
{
  std::vector<std::pair<double, double>> covered;
  const auto cover = [&](double from, double to) {
    const double turn = 2.0 * M_PI, low = from - turn * std::floor(from / turn);
    const double high = low + (to - from);
    covered.emplace_back(low, std::min(high, turn));
    if (high > turn) covered.emplace_back(0.0, high - turn);
  };
  for (std::size_t l = 0; l < discs.size(); ++l) {
    const double dx = discs[l].centre[0] - discs[k].centre[0];
    const double dy = discs[l].centre[1] - discs[k].centre[1];
    const double R = discs[k].radius, other = discs[l].radius, d = std::hypot(dx, dy);
    if (l == k || d >= R + other) continue;
    if (d + R <= other && (d + other > R || l < k))
      return {};  // of equal discs the first one stays
    if (d + other <= R) continue;
    const double half =
        std::acos(std::clamp((R * R + d * d - other * other) / (2.0 * R * d), -1.0, 1.0));
    cover(std::atan2(dy, dx) - half, std::atan2(dy, dx) + half);
  }
  std::sort(covered.begin(), covered.end());
  std::vector<std::pair<double, double>> free;
  double at = 0.0;
  for (const auto &[from, to] : covered) {
    if (from > at) free.emplace_back(at, from);
    at = std::max(at, to);
  }
  if (at < 2.0 * M_PI) free.emplace_back(at, 2.0 * M_PI);
  return free;
}

}  // namespace detail

/// Area and moments of a union of discs, by the arcs of its boundary.
inline Moments union_of_discs(const std::vector<Ball> &discs)
{
  Moments sum;
  for (std::size_t k = 0; k < discs.size(); ++k) {
    const Ball &disc = discs[k];
    for (const auto &[from, to] : detail::free_arcs(discs, k)) {
      add_arc(sum, disc.centre[0], disc.centre[1], disc.radius, from, to);
    }
  }
  return sum;
}

/// Volume and moments of a union of balls, by quadrature along z over its plane sections, which are
/// unions of discs: 40 nodes between each two heights at which a section gains or loses a disc, or
/// two of its discs begin or cease to overlap; denser towards both, as sections grow like square
/// roots there.
inline Moments union_of_balls(const std::vector<Ball> &balls)
{
  static const auto RULE = detail::gauss_legendre(40);
  std::vector<double> heights;
  for (std::size_t k = 0; k < balls.size(); ++k) {
    const Ball &p = balls[k];
    heights.insert(heights.end(), {p.centre[2] - p.radius, p.centre[2] + p.radius});
    for (std::size_t l = 0; l < k; ++l) {
      const Ball &q = balls[l];
      const Vec<3> apart = q.centre - p.centre;
      const double d = norm(apart);
      if (!(d > 0.0 && d < p.radius + q.radius && d > std::abs(p.radius - q.radius))) continue;
      // The circle that both surfaces share: its centre, its radius, and the tilt of its plane.
      const double along = (d * d + p.radius * p.radius - q.radius * q.radius) / (2.0 * d);
      const double radius = std::sqrt(std::max(0.0, p.radius * p.radius - along * along));
      const double middle = p.centre[2] + along * apart[2] / d;
      const double extent = radius * std::hypot(apart[0], apart[1]) / d;
      heights.insert(heights.end(), {middle - extent, middle + extent});
    }
  }
  std::sort(heights.begin(), heights.end());
  Moments sum;
  for (std::size_t m = 0; m + 1 < heights.size(); ++m) {
    const double middle = 0.5 * (heights[m] + heights[m + 1]);
    const double half = 0.5 * (heights[m + 1] - heights[m]);
    if (!(half > 0.0)) continue;
    for (const auto &[node, weight] : RULE) {
      const double angle = 0.5 * M_PI * node;
      const double z = middle + half * std::sin(angle);
      std::vector<Ball> section;
      for (const Ball &ball : balls) {
        const double h = z - ball.centre[2], square = ball.radius * ball.radius - h * h;
        if (square > 0.0) section.push_back({ball.centre, std::sqrt(square)});
      }
      const double w = half * 0.5 * M_PI * std::cos(angle) * weight;
      Moments own = union_of_discs(section);
      own.first[2] = z * own.measure;
      own.second[2] = z * z * own.measure;
      own.second[4] = z * own.first[0];
      own.second[5] = z * own.first[1];
      sum.add(w, own);
    }
  }
  return sum;
}

}  // namespace jamshape
