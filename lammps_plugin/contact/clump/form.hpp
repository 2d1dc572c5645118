#pragma once

#include "contact/clump/union.hpp"
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

/// Discs (balls in 3D) of a body of size 1, about its centre of area along its principal axes, and
/// what follows from them alone.
struct Discs {
  int dimension;
  std::vector<Ball> ball;
  SubstrateDrag drag;
  Vec<3> half_extents;    // of the box around them, along the principal axes
  double farthest = 0.0;  // centre of a disc
  double outer = 0.0;     // radius of the circle around all
  double smallest = 0.0;  // radius

  Discs(int D, std::vector<Ball> of, const Moments &by) : dimension(D), ball(std::move(of))
  {
    drag = drag_of(by);
    smallest = ball[0].radius;
    half_extents = {};
    for (const Ball &one : ball) {
      const double away = norm(one.centre);
      farthest = std::max(farthest, away);
      outer = std::max(outer, away + one.radius);
      smallest = std::min(smallest, one.radius);
      for (int k = 0; k < 3; ++k) {
        half_extents[k] = std::max(half_extents[k], std::abs(one.centre[k]) + one.radius);
      }
    }
  }
};

/// Discs per body that a search may take.
inline constexpr std::size_t MOST_DISCS = 255;

/// Reads rows x y z r of discs, with z = 0 in 2D; nothing for other rows. Rows of zeros at the
/// end fill up arrays.
inline std::optional<std::vector<Ball>> read_discs(const FormNumbers &numbers, int dimension)
{
  constexpr std::size_t WIDTH = 4;
  std::size_t rows = numbers.size() / WIDTH;
  const auto begin = [&](std::size_t row) { return numbers.begin() + WIDTH * row; };
  const auto is_zero = [](double x) { return x == 0.0; };
  if (rows * WIDTH != numbers.size()) return std::nullopt;
  while (rows > 0 && std::all_of(begin(rows - 1), begin(rows), is_zero)) --rows;
  std::vector<Ball> discs;
  for (std::size_t row = 0; row < rows; ++row) {
    const auto at = begin(row);
    const Ball one{{{at[0], at[1], at[2]}}, at[3]};
    if (!(one.radius > 0.0) || !std::isfinite(one.radius + norm(one.centre))) return std::nullopt;
    if (dimension == 2 && one.centre[2] != 0.0) return std::nullopt;
    discs.push_back(one);
  }
  if (discs.empty() || discs.size() > MOST_DISCS) return std::nullopt;
  return discs;
}

inline Moments moments_of(const std::vector<Ball> &discs, int dimension)
{
  return dimension == 2 ? union_of_discs(discs) : union_of_balls(discs);
}

/// The discs of a clump, shared by all particles of its type.
struct ClumpForm {
  std::shared_ptr<const Discs> discs;

  /// Returns nothing unless the numbers are discs about their centre of area, along principal axes.
  static std::optional<ClumpForm> from(const FormNumbers &numbers, int dimension)
  {
    const auto discs = read_discs(numbers, dimension);
    if (!discs) return std::nullopt;
    const Moments found = moments_of(*discs, dimension);
    if (!are_principal(found)) return std::nullopt;
    return ClumpForm{std::make_shared<const Discs>(dimension, *discs, found)};
  }
};

}  // namespace jamshape
