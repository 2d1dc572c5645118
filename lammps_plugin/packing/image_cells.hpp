#pragma once

#include "contact/math/vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace jamshape {

/// Points with spheres in a periodic box, sorted into cells, with all their images: the box may be
/// shorter than the search distance.
template <int D> class ImageCells {
 public:
  /// Cells for neighbours closer than `distance` among about n points.
  ImageCells(const Vec<D> &box_edges, double distance, std::size_t n) : edges(box_edges)
  {
    const double most = 1.0 + 2.0 * std::pow(static_cast<double>(n), 1.0 / D);  // few are empty
    std::size_t n_cells = 1;
    for (int k = 0; k < D; ++k) {
      count[k] = static_cast<long>(std::clamp(edges[k] / distance, 1.0, most));
      around[k] = static_cast<long>(std::ceil(distance * count[k] / edges[k]));
      n_cells *= static_cast<std::size_t>(count[k]);
    }
    parts.resize(n_cells);
  }

  std::size_t size() const { return n_points; }

  void add(std::size_t label, const Vec<D> &x, double radius)
  {
    std::size_t at = cell_of(x);
    while (parts[at].n == PER_PART) {
      if (parts[at].more == NONE) {
        parts[at].more = parts.size();
        parts.push_back({});
      }
      at = parts[at].more;
    }
    parts[at].points[parts[at].n++] = {x, radius, label, n_points++};
  }

  /// Whether `test(label, x - y)` holds for any image y of a point whose sphere meets one of this
  /// radius about x, of the points added after the first `but`: of those in the cell of x, where
  /// most hits are, and of those in the cells around it.
  template <class Test>
  bool any_here(const Vec<D> &x, double radius, std::size_t but, const Test &test) const
  {
    return any_of_cell(cell_of(x), Vec<D>{}, {x, radius, but}, test);
  }
  template <class Test>
  bool any_around(const Vec<D> &x, double radius, std::size_t but, const Test &test) const
  {
    const Sphere about{x, radius, but};
    return any_in(0, 0, Vec<D>{}, false, x, [&](std::size_t cell, const Vec<D> &image) {
      return any_of_cell(cell, image, about, test);
    });
  }

  /// Prefetches the memory that `any_here`, and that which `any_around` reads first.
  void fetch_here(const Vec<D> &x) const { fetch(cell_of(x), sizeof(Part)); }
  void fetch_around(const Vec<D> &x) const
  {
    any_in(0, 0, Vec<D>{}, false, x, [&](std::size_t cell, const Vec<D> &) {
      fetch(cell, 2 * LINE);
      return false;
    });
  }

  /// Whether `test(shift)` holds for any sum of edges shorter than a length, each pair of opposite
  /// sums once.
  template <class Test> bool any_shift(double length, const Test &test) const
  {
    return any_shift_from(0, false, length, Vec<D>{}, test);
  }

 private:
  static constexpr std::size_t NONE = static_cast<std::size_t>(-1);
  static constexpr std::size_t PER_PART = 4, LINE = 64;  // bytes of a cache line
  struct Point {
    Vec<D> x;
    double radius;
    std::size_t label, number;  // in the order in which they were added
  };
  struct Sphere {
    const Vec<D> &x;
    double radius;
    std::size_t but;
  };
  /// Points of a cell, contiguous in memory: fetching them dominates the time in a large box. The
  /// first shares a cache line with the numbers.
  struct alignas(LINE) Part {
    std::size_t n = 0, more = NONE;
    std::array<Point, PER_PART> points;
  };

  Vec<D> edges;
  std::array<long, D> count, around;
  std::vector<Part> parts;  // the first of each cell, then those of full cells
  std::size_t n_points = 0;

  std::size_t cell_along(int k, double x) const
  {
    const double at = static_cast<double>(count[k]) * (x / edges[k]);
    return static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(count[k] - 1)));
  }

  std::size_t cell_of(const Vec<D> &x) const
  {
    std::size_t cell = 0;
    for (int k = 0; k < D; ++k) cell = cell * count[k] + cell_along(k, x[k]);
    return cell;
  }

  void fetch(std::size_t cell, std::size_t size) const
  {
    const char *const from = reinterpret_cast<const char *>(&parts[cell]);
    for (std::size_t byte = 0; byte < size; byte += LINE) __builtin_prefetch(from + byte);
  }

  /// Whether `visit(cell, image)` holds for any of the cells around that of x.
  template <class Visit>
  bool any_in(int k, std::size_t cell, Vec<D> image, bool is_other, const Vec<D> &x,
              const Visit &visit) const
  {
    if (k == D) return is_other && visit(cell, image);
    const long centre = static_cast<long>(cell_along(k, x[k]));
    for (long c = centre - around[k]; c <= centre + around[k]; ++c) {
      const long turns = c >= 0 ? c / count[k] : -((count[k] - 1 - c) / count[k]);
      image[k] = static_cast<double>(turns);
      const auto own = static_cast<std::size_t>(c - turns * count[k]);
      if (any_in(k + 1, cell * count[k] + own, image, is_other || c != centre, x, visit))
        return true;
    }
    return false;
  }

  template <class Test>
  bool any_of_cell(std::size_t cell, const Vec<D> &image, const Sphere &about,
                   const Test &test) const
  {
    for (std::size_t at = cell; at != NONE; at = parts[at].more) {
      for (std::size_t p = 0; p < parts[at].n; ++p) {
        const Point &point = parts[at].points[p];
        if (point.number < about.but) continue;
        Vec<D> apart;
        for (int k = 0; k < D; ++k) {
          // Across the box the difference is large before an edge is subtracted: not in doubles.
          apart[k] = image[k] == 0.0 ? about.x[k] - point.x[k]
                                     : static_cast<double>(static_cast<long double>(about.x[k]) -
                                                           point.x[k] - image[k] * edges[k]);
        }
        const double reach = about.radius + point.radius;
        if (norm_sq(apart) < reach * reach && test(point.label, apart)) return true;
      }
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
