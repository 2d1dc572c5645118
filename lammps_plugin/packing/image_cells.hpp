#pragma once

#include "contact/math/vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace jamshape {

/// Points in a periodic box, sorted into cells, with all their images: the box may be shorter than
/// the distance that is asked for.
template <int D> class ImageCells {
 public:
  /// For neighbours closer than `distance` among about n points.
  ImageCells(const Vec<D> &box_edges, double distance, std::size_t n) : edges(box_edges)
  {
    const double most = 1.0 + 2.0 * std::pow(static_cast<double>(n), 1.0 / D);  // few are empty
    std::size_t n_cells = 1;
    for (int k = 0; k < D; ++k) {
      count[k] = static_cast<long>(std::clamp(edges[k] / distance, 1.0, most));
      around[k] = static_cast<long>(std::ceil(distance * count[k] / edges[k]));
      n_cells *= static_cast<std::size_t>(count[k]);
    }
    newest.assign(n_cells, NONE);
    points.reserve(n);
  }

  std::size_t size() const { return points.size(); }

  void add(std::size_t label, const Vec<D> &x)
  {
    std::size_t cell = 0;
    for (int k = 0; k < D; ++k) cell = cell * count[k] + cell_along(k, x[k]);
    points.push_back({x, label, newest[cell]});
    newest[cell] = points.size() - 1;
  }

  /// Whether `test(label, x - y)` holds for any image y of a point that may be near x, of the points
  /// added after the first `but`.
  template <class Test> bool any_near(const Vec<D> &x, std::size_t but, const Test &test) const
  {
    return any_in(0, 0, Vec<D>{}, x, but, test);
  }

  /// Whether `test(shift)` holds for any sum of edges shorter than a length, each and its opposite
  /// once.
  template <class Test> bool any_shift(double length, const Test &test) const
  {
    return any_shift_from(0, false, length, Vec<D>{}, test);
  }

 private:
  static constexpr std::size_t NONE = static_cast<std::size_t>(-1);
  struct Point {
    Vec<D> x;
    std::size_t label, before;  // the one added to its cell before it
  };

  Vec<D> edges;
  std::array<long, D> count, around;
  std::vector<std::size_t> newest;
  std::vector<Point> points;

  std::size_t cell_along(int k, double x) const
  {
    const double at = static_cast<double>(count[k]) * (x / edges[k]);
    return static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(count[k] - 1)));
  }

  template <class Test>
  bool any_in(int k, std::size_t cell, Vec<D> image, const Vec<D> &x, std::size_t but,
              const Test &test) const
  {
    if (k == D) return any_of_cell(cell, image, x, but, test);
    const long centre = static_cast<long>(cell_along(k, x[k]));
    for (long c = centre - around[k]; c <= centre + around[k]; ++c) {
      const long turns = c >= 0 ? c / count[k] : -((count[k] - 1 - c) / count[k]);
      image[k] = static_cast<double>(turns);
      const auto own = static_cast<std::size_t>(c - turns * count[k]);
      if (any_in(k + 1, cell * count[k] + own, image, x, but, test)) return true;
    }
    return false;
  }

  template <class Test>
  bool any_of_cell(std::size_t cell, const Vec<D> &image, const Vec<D> &x, std::size_t but,
                   const Test &test) const
  {
    for (std::size_t p = newest[cell]; p != NONE && p >= but; p = points[p].before) {
      Vec<D> apart;
      for (int k = 0; k < D; ++k) {
        // Across the box the difference is large and then loses an edge: not in doubles.
        apart[k] = image[k] == 0.0 ? x[k] - points[p].x[k]
                                   : static_cast<double>(static_cast<long double>(x[k]) -
                                                         points[p].x[k] - image[k] * edges[k]);
      }
      if (test(points[p].label, apart)) return true;
    }
    return false;
  }

  template <class Test>
  bool any_shift_from(int k, bool is_positive, double length, Vec<D> shift, const Test &test) const
  {
    if (k == D) return is_positive && norm_sq(shift) < length * length && test(shift);
    const long most = static_cast<long>(length / edges[k]);
    for (long turns = is_positive ? -most : 0; turns <= most; ++turns) {
      shift[k] = static_cast<double>(turns) * edges[k];
      if (any_shift_from(k + 1, is_positive || turns > 0, length, shift, test)) return true;
    }
    return false;
  }
};

}  // namespace jamshape
