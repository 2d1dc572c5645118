#pragma once

#include "contact/contact.hpp"
#include "contact/math/region.hpp"
#include "contact/math/vec.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace jamshape {

/// A side of the core of a rounded polygon: a segment, as the spine of a rod.
struct Side {
  Vec<2> middle, along;  // unit
  double half_length;
};

/// A convex polygon, its core, with a rounding radius: all points within that of the core. A body
/// of size 1, about its centre of area along its principal axes, corners counter-clockwise; one
/// corner is a disc, two are a rod.
struct RoundedPolygon {
  double rounding;
  std::vector<Vec<2>> corner;
  std::vector<Side> side;  // from each corner to the next; of a disc one of no length
  SubstrateDrag drag;
  Vec<3> half_extents;    // of the box around it, along the principal axes
  double farthest = 0.0;  // corner
  double width = 0.0;     // the smallest, between parallel lines

  RoundedPolygon(double radius, std::vector<Vec<2>> corners) :
      rounding(radius), corner(std::move(corners))
  {
    const std::size_t n = corner.size();
    for (std::size_t k = 0; k < (n > 2 ? n : 1); ++k) {
      const Vec<2> &from = corner[k], step = corner[(k + 1) % n] - from;
      const double length = norm(step);
      const Vec<2> along = length > 0.0 ? (1.0 / length) * step : Vec<2>{{1.0, 0.0}};
      side.push_back({from + 0.5 * step, along, 0.5 * length});
    }
    half_extents = {{rounding, rounding, rounding}};
    for (const Vec<2> &at : corner) {
      farthest = std::max(farthest, norm(at));
      for (int k = 0; k < 2; ++k) {
        half_extents[k] = std::max(half_extents[k], std::abs(at[k]) + rounding);
      }
    }
    width = 2.0 * rounding + width_of_core();
    drag = drag_of(moments());
  }

  /// Whether each corner turns to the left by less than half a turn, once around.
  bool is_convex() const
  {
    double turns = 0.0;
    for (std::size_t k = 0; k < side.size() && corner.size() > 2; ++k) {
      const Vec<2> &one = side[k].along, &next = side[(k + 1) % side.size()].along;
      const double sine = cross(one, next)[0];
      if (!(sine > 0.0) || !(side[k].half_length > 0.0)) return false;
      turns += std::atan2(sine, dot(one, next));
    }
    return corner.size() < 3 || turns < 3.0 * M_PI;
  }

  /// Integrals over the body, along its boundary: sides moved out by the radius, and arcs about the
  /// corners between them.
  Moments moments() const
  {
    Moments sum;
    const std::size_t n = side.size() > 1 ? side.size() : 2;  // a rod has the same side twice
    const auto along = [&](std::size_t k) {
      return k < side.size() ? side[k].along : -1.0 * side[0].along;
    };
    for (std::size_t k = 0; k < n; ++k) {
      const Vec<2> &from = corner[k % corner.size()], &to = corner[(k + 1) % corner.size()];
      const Vec<2> here = along(k), next = along((k + 1) % n);
      const Vec<2> out{{rounding * here[1], -rounding * here[0]}};
      add_line(sum, from + out, to + out);
      const double angle = std::atan2(here[1], here[0]) - 0.5 * M_PI;
      double turn = std::atan2(cross(here, next)[0], dot(here, next));
      if (turn <= 0.0) turn += 2.0 * M_PI;
      if (side.size() == 1) turn = M_PI;
      add_arc(sum, to[0], to[1], rounding, angle, angle + turn);
    }
    return sum;
  }

 private:
  double width_of_core() const
  {
    if (corner.size() < 3) return 0.0;
    double least = INFINITY;
    for (const Side &one : side) {
      double most = 0.0;
      for (const Vec<2> &at : corner) {
        most = std::max(most, cross(one.along, at - one.middle)[0]);
      }
      least = std::min(least, most);
    }
    return least;
  }
};

/// Corners that a body may have.
inline constexpr std::size_t MOST_CORNERS = 255;

/// Reads a rounding radius and corners x y; nothing for other numbers, or corners not convex and
/// counter-clockwise. Corners 0 0 at the end fill up arrays.
inline std::optional<RoundedPolygon> read_polygon(const FormNumbers &numbers)
{
  if (numbers.empty() || !(numbers[0] > 0.0) || numbers.size() % 2 == 0) return std::nullopt;
  std::vector<Vec<2>> corners;
  for (std::size_t k = 1; k < numbers.size(); k += 2) {
    corners.push_back({{numbers[k], numbers[k + 1]}});
    if (!std::isfinite(norm(corners.back()) + numbers[0])) return std::nullopt;
  }
  while (!corners.empty() && norm(corners.back()) == 0.0) corners.pop_back();
  if (corners.empty()) corners.push_back({});
  if (corners.size() > MOST_CORNERS) return std::nullopt;
  RoundedPolygon found(numbers[0], std::move(corners));
  return found.is_convex() ? std::optional<RoundedPolygon>(std::move(found)) : std::nullopt;
}

/// The polygon of a type, shared by all of its particles.
struct SpheropolygonForm {
  std::shared_ptr<const RoundedPolygon> polygon;

  /// Returns nothing unless the numbers are a polygon about its centre, along principal axes.
  static std::optional<SpheropolygonForm> from(const FormNumbers &numbers, int dimension)
  {
    auto found = dimension == 2 ? read_polygon(numbers) : std::nullopt;
    if (!found || !are_principal(found->moments())) return std::nullopt;
    return SpheropolygonForm{std::make_shared<const RoundedPolygon>(std::move(*found))};
  }
};

}  // namespace jamshape
